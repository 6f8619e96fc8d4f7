//! The vertical profile of cloud by type, as a formula: what the baked gradient holds.

/// The flattest type, stratus (type 0): `(a, b, c)` as fractions of the layer's height.
///
/// The profile rises from 0 at the base to 1 at `a` and falls from 1 at `b` to 0 at `c`. Thesis 4.2.1 \[Ford\] gives the form
/// and no numbers; these make a thin sheet in the lowest quarter.
pub const STRATUS_PROFILE: [f32; 3] = [0.05, 0.10, 0.25];

/// The tallest type, cumulus (type 1), as [`STRATUS_PROFILE`]: a flat base, and a body that thins towards the top of the layer.
pub const CUMULUS_PROFILE: [f32; 3] = [0.08, 0.35, 1.0];

/// Texels of the baked gradient along each side.
pub const GRADIENT_SIZE: u32 = 256;

/// How much cloud a type has at a height: `remap(h, 0, a, 0, 1) · remap(h, b, c, 1, 0)`, each clamped to \[0, 1\], with
/// `(a, b, c)` going from stratus to cumulus by the square root of the type (thesis 4.2.1 and 4.3 \[Ford\]).
///
/// `cloud_type` is 0 (stratus) to 1 (cumulus), `height` 0 (base of the layer) to 1 (top); the result is 0 to 1. The shader
/// that bakes the gradient does the same sum.
#[must_use]
pub fn vertical_profile(cloud_type: f32, height: f32) -> f32 {
    let share = cloud_type.clamp(0.0, 1.0).sqrt();
    let [a, b, c]: [f32; 3] =
        std::array::from_fn(|i| STRATUS_PROFILE[i] + (CUMULUS_PROFILE[i] - STRATUS_PROFILE[i]) * share);
    (height / a).clamp(0.0, 1.0) * ((c - height) / (c - b)).clamp(0.0, 1.0)
}
