// Pass: the shadow planes as tinted glass, solid where their texture blocks. Drawn over the forward pass, twice:
// what lies in front of the model, and faintly what lies inside it or behind.

// Scales the opacity of the whole pass.
override OPACITY: f32;

// Opacity of open and of blocking texels: the model must stay visible through the first.
const OPEN: f32 = 0.22;
const BLOCKING: f32 = 0.85;
// Width of the outline, pixels.
const OUTLINE_PX: f32 = 2.0;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) ab: vec2f,
    @location(1) @interpolate(flat) rectangle: u32,
}

// Two triangles an instance.
@vertex
fn vs_rectangle(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Corner {
    var corners = array(
        vec2f(0.0, 0.0), vec2f(1.0, 0.0), vec2f(1.0, 1.0),
        vec2f(0.0, 0.0), vec2f(1.0, 1.0), vec2f(0.0, 1.0),
    );
    let ab = corners[vertex];
    let p = rectangles[instance].origin.xyz + ab.x * rectangles[instance].u.xyz + ab.y * rectangles[instance].v.xyz;
    return Corner(instances[0].clip_from_unit * vec4f(p, 1.0), ab, instance);
}

@fragment
fn fs_rectangle(corner: Corner) -> @location(0) vec4f {
    let to_edge_px = min(corner.ab, 1.0 - corner.ab) / max(fwidth(corner.ab), vec2f(1e-9));
    let outline = 1.0 - smoothstep(OUTLINE_PX - 1.0, OUTLINE_PX, min(to_edge_px.x, to_edge_px.y));
    let coverage = sample(slot_of(rectangles[corner.rectangle].slot), clamp(corner.ab, vec2f(0.0), vec2f(1.0)));
    let opacity = mix(mix(OPEN, BLOCKING, coverage), 1.0, outline);
    return vec4f(rectangles[corner.rectangle].color.rgb, OPACITY * opacity);
}
