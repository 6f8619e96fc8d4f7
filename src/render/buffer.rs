//! The resolved clouds as an image of the user's.

use bevy::{
    asset::RenderAssetUsages,
    prelude::*,
    render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages},
};

/// On a camera with [`CloudView`](crate::CloudView): every frame the resolved clouds are written into this image.
///
/// RGB is radiance (cd/m², exposure not applied, aerial perspective included), A is transmittance: 1 where there is no
/// cloud. What is behind shows as `rgb + a · background`. Pixels past the image's or the view's edge are left alone.
/// Costs one full-size pass. Make the image with [`CloudBuffer::image`]; read it back with Bevy's `Readback`.
#[derive(Component, Reflect, Clone, Debug)]
#[reflect(Component, Clone)]
pub struct CloudBuffer(pub Handle<Image>);

impl CloudBuffer {
    /// An image of this size (px) that the buffer can be written to: `Rgba32Float`.
    pub fn image(width: u32, height: u32) -> Image {
        let size = Extent3d { width: width.max(1), height: height.max(1), depth_or_array_layers: 1 };
        let mut image = Image::new_fill(
            size,
            TextureDimension::D2,
            &[0; 16],
            TextureFormat::Rgba32Float,
            RenderAssetUsages::RENDER_WORLD,
        );
        image.texture_descriptor.usage =
            TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC;
        image
    }
}
