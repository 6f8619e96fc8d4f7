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
        blank(width, height, TextureFormat::Rgba32Float, TextureUsages::STORAGE_BINDING)
    }
}

/// On a camera with [`CloudView`](crate::CloudView): every frame the newest marched frame, as the sliding window stores
/// it, is copied into this image's top left.
///
/// RGB is radiance times the exposure when the history began, A transmittance, at the marched size (the view's divided
/// by 1, 2 or 4, rounded up). For looking at single frames; make the image with [`CloudFrame::image`].
#[derive(Component, Reflect, Clone, Debug)]
#[reflect(Component, Clone)]
pub struct CloudFrame(pub Handle<Image>);

impl CloudFrame {
    /// An image of this size (texels) that frames can be copied to: `Rgba16Float`.
    pub fn image(width: u32, height: u32) -> Image {
        blank(width, height, TextureFormat::Rgba16Float, TextureUsages::COPY_DST)
    }
}

fn blank(width: u32, height: u32, format: TextureFormat, write: TextureUsages) -> Image {
    let size = Extent3d { width: width.max(1), height: height.max(1), depth_or_array_layers: 1 };
    let texel = [0; 16];
    let bytes = if format == TextureFormat::Rgba32Float { 16 } else { 8 };
    let mut image = Image::new_fill(
        size,
        TextureDimension::D2,
        &texel[..bytes],
        format,
        RenderAssetUsages::RENDER_WORLD,
    );
    image.texture_descriptor.usage =
        write | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC;
    image
}
