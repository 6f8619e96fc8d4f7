//! The resolved clouds as an image of the user's.

use bevy::{
    asset::RenderAssetUsages,
    platform::collections::HashSet,
    prelude::*,
    render::{
        render_asset::RenderAssets,
        render_resource::{Extent3d, Texture, TextureDimension, TextureFormat, TextureUsages},
        texture::GpuImage,
    },
};

use super::view::ExtractedCloudView;

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

/// On a camera with [`CloudView`](crate::CloudView): every frame, before anything transparent is drawn, where the clouds
/// are is written into this image, so that particles, water and fog can fade into them.
///
/// R is transmittance (1 where there is no cloud before the opaque scene), G the clouds' mean distance, weighted by
/// opacity, B the distance at which they begin, both in kilometres (65 504 where there are none); A is 1. One texel a
/// pixel of the view, from its top left; pixels past the image's or the view's edge are left alone. Costs one full-size
/// pass. Make the image with [`CloudDepth::image`].
///
/// A material binds it as any other texture and asks `cloud_fade` how much of the cloud is before a fragment:
/// ```wgsl
/// import bevy_pbr::render::{forward_io::VertexOutput, mesh_view_bindings::view};
/// import bevy_cumulus::cloud_fade;
///
/// let pixel = vec2<i32>(mesh.position.xy - view.viewport.xy);
/// let distance = length(mesh.world_position.xyz - view.world_position);
/// color.a *= cloud_fade(textureLoad(clouds, pixel, 0), distance);
/// ```
/// `examples/cloud_depth.rs` is a whole one.
#[derive(Component, Reflect, Clone, Debug)]
#[reflect(Component, Clone)]
pub struct CloudDepth(pub Handle<Image>);

impl CloudDepth {
    /// An image of this size (px) that the clouds' depth can be written to: `Rgba16Float`, which may be filtered.
    pub fn image(width: u32, height: u32) -> Image {
        blank(width, height, TextureFormat::Rgba16Float, TextureUsages::STORAGE_BINDING)
    }
}

/// On a camera with [`CloudView`](crate::CloudView): every frame the newest marched frame, as the sliding window stores
/// it, is copied into this image's top left.
///
/// RGB is radiance times the camera's exposure, A transmittance, at the marched size (the view's divided
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

/// On a camera whose clouds are path-traced: every frame the noise of the picture so far is written into this image.
///
/// R is the standard error of the radiance's luminance (cd/m²), G that of transmittance, both from the samples' own
/// variance; B is the number of samples; A is the share of the paths' weight that the safety stop (20 000 events) cut off.
/// One texel a pixel. Make the image with [`CloudNoise::image`].
#[derive(Component, Reflect, Clone, Debug)]
#[reflect(Component, Clone)]
pub struct CloudNoise(pub Handle<Image>);

impl CloudNoise {
    /// An image of this size (px) that the noise can be written to: `Rgba32Float`.
    pub fn image(width: u32, height: u32) -> Image {
        CloudBuffer::image(width, height)
    }
}

fn blank(width: u32, height: u32, format: TextureFormat, write: TextureUsages) -> Image {
    let size = Extent3d { width: width.max(1), height: height.max(1), depth_or_array_layers: 1 };
    let texel = [0; 16];
    let bytes = if format == TextureFormat::Rgba32Float { 16 } else { 8 };
    let mut image =
        Image::new_fill(size, TextureDimension::D2, &texel[..bytes], format, RenderAssetUsages::RENDER_WORLD);
    image.texture_descriptor.usage = write | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC;
    image
}

/// What keeps `texture` from being a plain 2D one of this format and use.
fn unfit(texture: &Texture, format: TextureFormat, usage: TextureUsages) -> Option<String> {
    if texture.format() != format {
        Some(format!("its format is {:?}, and {format:?} is needed", texture.format()))
    } else if !texture.usage().contains(usage) {
        Some(format!("its usage lacks {usage:?}"))
    } else if texture.dimension() != TextureDimension::D2
        || texture.depth_or_array_layers() != 1
        || texture.mip_level_count() != 1
        || texture.sample_count() != 1
    {
        Some("it is not a plain 2D image of one layer, mip level and sample".to_owned())
    } else {
        None
    }
}

/// Refuses images that the passes could not write to, each with one error.
pub(crate) fn refuse_unfit_images(
    mut views: Query<&mut ExtractedCloudView>,
    images: Res<RenderAssets<GpuImage>>,
    mut refused: Local<HashSet<(&'static str, AssetId<Image>)>>,
) {
    let mut check = |slot: &mut Option<AssetId<Image>>, name: &'static str, format, usage| {
        let Some(id) = *slot else { return };
        let Some(image) = images.get(id) else { return };
        let Some(why) = unfit(&image.texture, format, usage) else {
            refused.remove(&(name, id));
            return;
        };
        if refused.insert((name, id)) {
            error!("clouds: the image of {name} cannot be used: {why}; make it with {name}::image");
        }
        *slot = None;
    };
    for mut view in &mut views {
        let view = &mut *view;
        check(&mut view.buffer, "CloudBuffer", TextureFormat::Rgba32Float, TextureUsages::STORAGE_BINDING);
        check(&mut view.depth, "CloudDepth", TextureFormat::Rgba16Float, TextureUsages::STORAGE_BINDING);
        check(&mut view.noise, "CloudNoise", TextureFormat::Rgba32Float, TextureUsages::STORAGE_BINDING);
        check(&mut view.frame, "CloudFrame", TextureFormat::Rgba16Float, TextureUsages::COPY_DST);
    }
}
