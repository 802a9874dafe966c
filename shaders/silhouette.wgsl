// Pass: the casters as a light sees them, 1 wherever one is.

@fragment
fn fs_silhouette(depth: Depth) -> @location(0) f32 {
    if HAS_HOLES && is_hole_at(depth.material, depth.uv) {
        discard;
    }
    return 1.0;
}
