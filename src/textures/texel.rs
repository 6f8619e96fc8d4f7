//! Texels as numbers.

use bevy::render::render_resource::TextureFormat;
use half::f16;

/// Reads one texel; channels that the format lacks are 0, alpha 1. `None` for formats that no slot takes.
pub(crate) fn decoder(format: TextureFormat) -> Option<fn(&[u8]) -> [f32; 4]> {
    match format {
        TextureFormat::R8Unorm | TextureFormat::Rg8Unorm | TextureFormat::Rgba8Unorm => Some(bytes),
        TextureFormat::R16Float | TextureFormat::Rg16Float | TextureFormat::Rgba16Float => Some(halves),
        _ => None,
    }
}

fn bytes(texel: &[u8]) -> [f32; 4] {
    let mut channels = [0.0, 0.0, 0.0, 1.0];
    for (channel, byte) in channels.iter_mut().zip(texel) {
        *channel = f32::from(*byte) / 255.0;
    }
    channels
}

fn halves(texel: &[u8]) -> [f32; 4] {
    let mut channels = [0.0, 0.0, 0.0, 1.0];
    for (channel, pair) in channels.iter_mut().zip(texel.chunks_exact(2)) {
        *channel = f16::from_le_bytes([pair[0], pair[1]]).to_f32();
    }
    channels
}
