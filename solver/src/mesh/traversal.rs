//! Shadow rays through the BVH: does anything lie on a ray?
//!
//! The traversal is that of obvhs (Ylitie, Karras, Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed
//! Wide BVHs", 2017). The eight boxes of a node are tested here, as one vector of the widest kind that the processor has:
//! the crate's own test takes four at a time, in what every x86-64 has. Products and sums are rounded one by one, so
//! that every processor gives the same answer.

use glam::{UVec2, Vec3A};
use obvhs::{
    cwbvh::{CwBvh, node::CwBvhNode},
    ray::Ray,
    traverse,
};
use pulp::{Arch, Simd, WithSimd};

/// Children of a node.
const WIDTH: usize = 8;

/// Does `blocks` say so of any primitive whose box the ray meets? The nearest ones are asked first, about.
pub(super) fn any_hit(bvh: &CwBvh, ray: &Ray, blocks: impl FnMut(u32) -> bool) -> bool {
    Arch::new().dispatch(AnyHit { bvh, ray, blocks })
}

/// What [`any_hit`] is asked. A closure in the place of this would be compiled for every x86-64: its adapter is not
/// inlined into the function that has the vectors.
struct AnyHit<'a, F> {
    bvh: &'a CwBvh,
    ray: &'a Ray,
    blocks: F,
}

impl<F: FnMut(u32) -> bool> WithSimd for AnyHit<'_, F> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> bool {
        let mut state = self.bvh.new_traversal(self.ray.direction);
        let mut node;
        traverse!(self.bvh, node, state, met(node, self.ray, state.oct_inv4), {
            if (self.blocks)(state.primitive_id) {
                return true;
            }
        });
        false
    }
}

/// The children whose boxes the ray meets, as the traversal wants them: 24 bits of primitives, 8 of nodes.
#[inline(always)]
fn met(node: &CwBvhNode, ray: &Ray, octant: u32) -> u32 {
    let scale = node.compute_extent() * ray.inv_direction;
    let start = (Vec3A::from(node.p) - ray.origin) * ray.inv_direction;
    let ordered = |low, high, direction: f32| if direction < 0.0 { (high, low) } else { (low, high) };
    let (near_x, far_x) = ordered(&node.child_min_x, &node.child_max_x, ray.direction.x);
    let (near_y, far_y) = ordered(&node.child_min_y, &node.child_max_y, ray.direction.y);
    let (near_z, far_z) = ordered(&node.child_min_z, &node.child_max_z, ray.direction.z);
    let mut children = [0u32; WIDTH];
    for i in 0..WIDTH {
        let x = |q: &[u8; WIDTH]| f32::from(q[i]) * scale.x + start.x;
        let y = |q: &[u8; WIDTH]| f32::from(q[i]) * scale.y + start.y;
        let z = |q: &[u8; WIDTH]| f32::from(q[i]) * scale.z + start.z;
        let enters = larger(larger(x(near_x), y(near_y)), larger(z(near_z), 0.0));
        let leaves = smaller(x(far_x), smaller(y(far_y), z(far_z)));
        // Three bits count the child's primitives, or the lowest says that it is a node; five say where they stand, those
        // of a node turned so that the nearest comes first.
        let meta = u32::from(node.child_meta[i]);
        let is_node = meta & (meta << 1) & 0x10 != 0;
        let position = (meta ^ if is_node { octant & 0xff } else { 0 }) & 0x1f;
        children[i] = if enters <= leaves { (meta >> 5) << position } else { 0 };
    }
    children.into_iter().fold(0, |all, child| all | child)
}

/// One instruction, as long as nobody cares for NaN.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
