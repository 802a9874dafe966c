// Pass: shadow volumes into a float target, each face with what its casters do to the light.

// Of a caster: the logarithm of what it lets pass, per colour; 1 in the last component where it is opaque.
@group(2) @binding(0) var<storage, read> weights: array<vec4f>;

// Faces behind the surface count: those that look away from the eye leave a volume that the surface is in.
fn weight_of(face: VolumeVertex, front: bool) -> vec4f {
    return select(1.0, -1.0, front) * f32(face.count) * weights[face.caster];
}

// To be added.
@fragment
fn fs_sum(face: VolumeVertex, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    return weight_of(face, front);
}

// Colours to be multiplied; the opaque casters are still added.
@fragment
fn fs_product(face: VolumeVertex, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    let weight = weight_of(face, front);
    return vec4f(exp(weight.rgb), weight.a);
}
