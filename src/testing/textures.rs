//! Contents of the baked textures, read back to the CPU.

use bevy::{
    prelude::*,
    render::{
        RenderApp,
        render_resource::{
            BufferDescriptor, BufferUsages, CommandEncoderDescriptor, Extent3d, MapMode, Origin3d, PollType,
            TexelCopyBufferInfo, TexelCopyBufferLayout, TexelCopyTextureInfo, TextureAspect, TextureDimension,
            TextureUsages,
        },
        renderer::{RenderDevice, RenderQueue},
    },
};

use crate::textures::{Bakery, CloudTextureSlot, CloudTextureViews, decoder};

/// One level of a texture, in the order x, y, z.
#[derive(Clone, PartialEq, Debug)]
pub struct Captured {
    /// Width, height, depth.
    pub size: UVec3,
    /// Texels; channels the texture lacks are 0, alpha 1.
    pub texels: Vec<[f32; 4]>,
}

impl Captured {
    /// The texel at `at`, wrapping around each axis.
    pub fn at(&self, at: IVec3) -> [f32; 4] {
        let at = at.rem_euclid(self.size.as_ivec3()).as_uvec3();
        self.texels[((at.z * self.size.y + at.y) * self.size.x + at.x) as usize]
    }
}

/// Number of mip levels of what a slot shows; 0 while it shows nothing.
pub fn levels(app: &App, slot: CloudTextureSlot) -> u32 {
    app.get_sub_app(RenderApp)
        .and_then(|render| render.world().get_resource::<Bakery>()?.texture(slot).map(|t| t.mip_level_count()))
        .unwrap_or(0)
}

/// Count of changes of any slot, and whether all of them show something.
pub fn generation(app: &App) -> (u64, bool) {
    app.get_sub_app(RenderApp)
        .and_then(|render| render.world().get_resource::<CloudTextureViews>())
        .map_or((0, false), |views| (views.generation, views.is_ready()))
}

/// Reads one level of what a slot shows. The app must not be pipelined; blocks until the GPU is done.
///
/// # Errors
/// Says what is missing.
pub fn read(app: &App, slot: CloudTextureSlot, level: u32) -> Result<Captured, String> {
    let world = app.get_sub_app(RenderApp).ok_or("no render app")?.world();
    let texture = world
        .get_resource::<Bakery>()
        .and_then(|bakery| bakery.texture(slot))
        .ok_or_else(|| format!("{slot} shows nothing yet"))?;
    if !texture.usage().contains(TextureUsages::COPY_SRC) {
        return Err(format!("{slot} shows a texture without COPY_SRC"));
    }
    let (device, queue) = (world.resource::<RenderDevice>(), world.resource::<RenderQueue>());
    let whole = texture.size();
    let depth = if texture.dimension() == TextureDimension::D3 { whole.depth_or_array_layers >> level } else { 1 };
    let size = UVec3::new(whole.width >> level, whole.height >> level, depth).max(UVec3::ONE);
    let decode = decoder(texture.format()).ok_or_else(|| format!("cannot decode {:?}", texture.format()))?;
    let texel_bytes = texture.format().block_copy_size(None).ok_or("unknown format")?;
    let row_bytes = (size.x * texel_bytes).next_multiple_of(256);
    let buffer = device.create_buffer(&BufferDescriptor {
        label: Some("cloud_capture"),
        size: u64::from(row_bytes) * u64::from(size.y * size.z),
        usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        TexelCopyTextureInfo { texture, mip_level: level, origin: Origin3d::ZERO, aspect: TextureAspect::All },
        TexelCopyBufferInfo {
            buffer: &buffer,
            layout: TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row_bytes), rows_per_image: Some(size.y) },
        },
        Extent3d { width: size.x, height: size.y, depth_or_array_layers: size.z },
    );
    queue.submit([encoder.finish()]);
    buffer.slice(..).map_async(MapMode::Read, |_| {});
    device.poll(PollType::wait_indefinitely()).map_err(|error| error.to_string())?;
    let bytes = buffer.slice(..).get_mapped_range().map_err(|error| error.to_string())?;
    let mut texels = Vec::with_capacity(size.element_product() as usize);
    for row in bytes.chunks_exact(row_bytes as usize) {
        let row = &row[..(size.x * texel_bytes) as usize];
        for texel in row.chunks_exact(texel_bytes as usize) {
            texels.push(decode(texel));
        }
    }
    Ok(Captured { size, texels })
}
