// Pass: shadow volumes into the stencil. No colour is written.

@fragment
fn fs_volume() -> @location(0) vec4f {
    return vec4f(0.0);
}
