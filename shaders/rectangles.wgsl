// Snippet: all planes as things to look at (mode `planes`), whether they cast under this light or not.

struct Rectangle {
    origin: vec4f,
    // Edges, full length.
    u: vec4f,
    v: vec4f,
    // The plane's equation (n, -n.o) and the duals of the edges: dot with (p, 1).
    plane: vec4f,
    a: vec4f,
    b: vec4f,
    // Linear RGB.
    color: vec4f,
    // As a plane's last texel in `casting`.
    slot: vec4u,
}

@group(2) @binding(3) var<storage, read> rectangles: array<Rectangle>;
