//! The compute pipelines that bake, and what one dispatch is told.

use bevy::{
    asset::{AssetServer, load_embedded_asset},
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, CachedComputePipelineId, ComputePipelineDescriptor,
        PipelineCache, ShaderStages, ShaderType, StorageTextureAccess, TextureFormat, TextureSampleType,
        binding_types::{texture_2d, texture_3d, texture_storage_2d, texture_storage_3d, uniform_buffer},
    },
};

/// Format of the noise volumes.
pub(super) const VOLUME_FORMAT: TextureFormat = TextureFormat::Rgba8Unorm;
/// Format of maps and gradient.
pub(super) const MAP_FORMAT: TextureFormat = TextureFormat::Rgba16Float;

/// What one dispatch is told; `Bake` in noise.wesl.
#[derive(ShaderType, Clone, Copy, Default)]
pub(super) struct BakeParams {
    pub seed: u32,
    pub cells: u32,
    pub octaves: u32,
    pub first: u32,
    pub stratus: Vec4,
    pub cumulus: Vec4,
}

/// One entry point of one shader.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Kernel {
    Billow,
    Wisp,
    Shape,
    VolumeMip,
    Coverage,
    TypeMap,
    Gradient,
    FirstLevel,
    NextLevel,
}

impl Kernel {
    const ALL: [Self; 9] = [
        Self::Billow,
        Self::Wisp,
        Self::Shape,
        Self::VolumeMip,
        Self::Coverage,
        Self::TypeMap,
        Self::Gradient,
        Self::FirstLevel,
        Self::NextLevel,
    ];

    pub(super) fn is_volume(self) -> bool {
        matches!(self, Self::Billow | Self::Wisp | Self::Shape | Self::VolumeMip)
    }

    fn entry_point(self) -> &'static str {
        match self {
            Self::Billow => "billow",
            Self::Wisp => "wisp",
            Self::Shape => "shape",
            Self::VolumeMip => "mip",
            Self::Coverage => "coverage",
            Self::TypeMap => "type_map",
            Self::Gradient => "gradient",
            Self::FirstLevel => "first_level",
            Self::NextLevel => "next_level",
        }
    }

    fn shader(self, assets: &AssetServer) -> Handle<Shader> {
        match self {
            Self::Billow | Self::Wisp | Self::Shape => load_embedded_asset!(assets, "volumes.wesl"),
            Self::VolumeMip => load_embedded_asset!(assets, "volume_mip.wesl"),
            Self::Coverage | Self::TypeMap | Self::Gradient => {
                load_embedded_asset!(assets, "maps.wesl")
            }
            Self::FirstLevel | Self::NextLevel => load_embedded_asset!(assets, "pyramid.wesl"),
        }
    }

    /// Binding 0 the parameters, then the texture read if there is one, then the texture written.
    fn layout(self) -> BindGroupLayoutDescriptor {
        let params = uniform_buffer::<BakeParams>(false);
        let loaded = TextureSampleType::Float { filterable: false };
        let write = StorageTextureAccess::WriteOnly;
        let compute = ShaderStages::COMPUTE;
        match self {
            Self::Billow | Self::Wisp | Self::Shape => BindGroupLayoutDescriptor::new(
                "cloud_volume_layout",
                &BindGroupLayoutEntries::sequential(compute, (params, texture_storage_3d(VOLUME_FORMAT, write))),
            ),
            Self::VolumeMip => BindGroupLayoutDescriptor::new(
                "cloud_volume_mip_layout",
                &BindGroupLayoutEntries::sequential(
                    compute,
                    (params, texture_3d(loaded), texture_storage_3d(VOLUME_FORMAT, write)),
                ),
            ),
            Self::Coverage | Self::TypeMap | Self::Gradient => BindGroupLayoutDescriptor::new(
                "cloud_map_layout",
                &BindGroupLayoutEntries::sequential(compute, (params, texture_storage_2d(MAP_FORMAT, write))),
            ),
            Self::FirstLevel | Self::NextLevel => BindGroupLayoutDescriptor::new(
                "cloud_pyramid_layout",
                &BindGroupLayoutEntries::sequential(
                    compute,
                    (params, texture_2d(loaded), texture_storage_2d(MAP_FORMAT, write)),
                ),
            ),
        }
    }
}

/// All of them, queued when a device is acquired.
#[derive(Resource)]
pub(super) struct BakePipelines([(BindGroupLayoutDescriptor, CachedComputePipelineId); 9]);

impl BakePipelines {
    pub(super) fn get(&self, kernel: Kernel) -> &(BindGroupLayoutDescriptor, CachedComputePipelineId) {
        &self.0[kernel as usize]
    }
}

impl FromWorld for BakePipelines {
    fn from_world(world: &mut World) -> Self {
        let assets = world.resource::<AssetServer>();
        let cache = world.resource::<PipelineCache>();
        Self(Kernel::ALL.map(|kernel| {
            let layout = kernel.layout();
            let id = cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(format!("cloud_bake_{}", kernel.entry_point()).into()),
                layout: vec![layout.clone()],
                shader: kernel.shader(assets),
                entry_point: Some(kernel.entry_point().into()),
                ..default()
            });
            (layout, id)
        }))
    }
}
