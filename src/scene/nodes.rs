//! The node hierarchy: which meshes stand where.
//!
//! In: the nodes and scenes of a document. Out: the nodes of the default scene in depth-first order, with their
//! transforms to model space, composed in f64. Iterative: a chain of a million nodes needs no stack.
//!
//! Refused: a node with two parents, a cycle (even in a part that no scene shows), a scene root that is a child,
//! and transforms that are not finite, affine numbers. The default scene is `scene`, else scene 0; in a file
//! without scenes all nodes without a parent are roots.

use super::{Fault, document};
use document::Document;
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// How far the last row of a node matrix may be from (0, 0, 0, 1): exporters write rounding noise of 1e-7; a
/// perspective matrix has entries near 1.
const AFFINE_TOLERANCE: f64 = 1e-4;

/// The hierarchy with composed transforms.
pub(super) struct Hierarchy {
    /// Model space from node space, one a node of the document.
    pub model_from_node: Vec<DAffine3>,
    /// The nodes of the default scene, parents before children, depth first.
    pub shown: Vec<usize>,
}

impl Hierarchy {
    /// Checks the nodes and composes their transforms.
    ///
    /// # Errors
    /// A hierarchy that is not a forest, an index out of range, or a transform that is not finite and affine.
    pub(super) fn new(document: &Document) -> Result<Self, Fault> {
        let nodes = &document.nodes;
        let parents = parents(nodes)?;
        let tops: Vec<usize> = (0..nodes.len()).filter(|node| parents[*node].is_none()).collect();
        // Every node hangs below a top exactly once, or it is in a cycle.
        let order = depth_first(nodes, &tops);
        let mut model_from_node = vec![DAffine3::IDENTITY; nodes.len()];
        let mut reached = vec![false; nodes.len()];
        for &node in &order {
            let pointer = format!("/nodes/{node}");
            let parent = parents[node].map_or(DAffine3::IDENTITY, |parent| model_from_node[parent]);
            let composed = parent * local_transform(&nodes[node], &pointer)?;
            if !composed.is_finite() {
                return Err(Fault::new(pointer, "the composed transform is not a finite number"));
            }
            model_from_node[node] = composed;
            reached[node] = true;
        }
        if let Some(node) = reached.iter().position(|reached| !reached) {
            return Err(Fault::new(format!("/nodes/{node}"), "is its own ancestor: nodes must not form a cycle"));
        }
        let shown = match scene_roots(document, &parents)? {
            Some(roots) => depth_first(nodes, roots),
            None => order,
        };
        Ok(Self { model_from_node, shown })
    }
}

/// The parent of each node.
fn parents(nodes: &[document::Node]) -> Result<Vec<Option<usize>>, Fault> {
    let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
    for (node, record) in nodes.iter().enumerate() {
        for (i, &child) in record.children.iter().enumerate() {
            let pointer = format!("/nodes/{node}/children/{i}");
            match parents.get_mut(child) {
                None => return Err(Fault::index(&pointer, child, "nodes", nodes.len())),
                Some(Some(other)) => {
                    return Err(Fault::new(pointer, format!("node {child} is already a child of node {other}")));
                }
                Some(parent) => *parent = Some(node),
            }
        }
    }
    Ok(parents)
}

/// The roots of the default scene, or `None` in a file without scenes.
fn scene_roots<'a>(document: &'a Document, parents: &[Option<usize>]) -> Result<Option<&'a [usize]>, Fault> {
    let scenes = &document.scenes;
    let index = document.scene.unwrap_or(0);
    let Some(scene) = scenes.get(index) else {
        return match document.scene {
            Some(index) => Err(Fault::index("/scene", index, "scenes", scenes.len())),
            None => Ok(None),
        };
    };
    let mut listed = vec![false; parents.len()];
    for (i, &root) in scene.nodes.iter().enumerate() {
        let pointer = format!("/scenes/{index}/nodes/{i}");
        match parents.get(root) {
            None => return Err(Fault::index(&pointer, root, "nodes", parents.len())),
            Some(Some(parent)) => {
                return Err(Fault::new(pointer, format!("node {root} is a child of node {parent}, not a root")));
            }
            Some(None) if listed[root] => return Err(Fault::new(pointer, format!("node {root} is listed twice"))),
            Some(None) => listed[root] = true,
        }
    }
    Ok(Some(&scene.nodes))
}

/// The nodes at and below `roots`, parents first, children in their order. Ends, because every node has at most
/// one parent and a root has none.
fn depth_first(nodes: &[document::Node], roots: &[usize]) -> Vec<usize> {
    let mut order = Vec::new();
    let mut stack: Vec<usize> = roots.iter().rev().copied().collect();
    while let Some(node) = stack.pop() {
        order.push(node);
        stack.extend(nodes[node].children.iter().rev());
    }
    order
}

/// Parent space from node space.
fn local_transform(node: &document::Node, pointer: &str) -> Result<DAffine3, Fault> {
    if let Some(m) = node.matrix {
        let row = [m[3], m[7], m[11], m[15] - 1.0];
        if row.iter().any(|x| x.abs() > AFFINE_TOLERANCE) {
            return Err(Fault::new(format!("{pointer}/matrix"), "the last row is not 0 0 0 1"));
        }
        let column = |i: usize| DVec3::new(m[4 * i], m[4 * i + 1], m[4 * i + 2]);
        let linear = DMat3::from_cols(column(0), column(1), column(2));
        return Ok(DAffine3 { matrix3: linear, translation: column(3) });
    }
    placement(
        DVec3::from(node.translation.unwrap_or([0.0; 3])),
        node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]),
        DVec3::from(node.scale.unwrap_or([1.0; 3])),
    )
    .ok_or_else(|| Fault::new(format!("{pointer}/rotation"), "the quaternion has no length"))
}

/// Scale, then rotate by a quaternion x, y, z, w (normalised here), then move. `None` if the quaternion has no
/// length.
pub(super) fn placement(translation: DVec3, rotation: [f64; 4], scale: DVec3) -> Option<DAffine3> {
    let length = DQuat::from_array(rotation).length();
    if !(length.is_finite() && length > 0.0) {
        return None;
    }
    let rotation = DQuat::from_array(rotation.map(|x| x / length));
    Some(DAffine3::from_scale_rotation_translation(scale, rotation, translation))
}
