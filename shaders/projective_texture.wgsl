// Technique: the casters' silhouette, projected from the light (Segal et al. 1992).

// 1 where a caster blocks the light; one layer a face.
@group(2) @binding(1) var silhouettes: texture_2d_array<f32>;
@group(2) @binding(2) var silhouette_sampler: sampler;

fn predicted_visibility(surface: Surface) -> vec3f {
    let view = in_light_view(surface);
    if !view.inside {
        return vec3f(1.0);
    }
    return vec3f(1.0 - textureSampleLevel(silhouettes, silhouette_sampler, view.uv, view.face, 0.0).r);
}
