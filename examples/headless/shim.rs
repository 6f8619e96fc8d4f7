pub mod prelude {
    pub use super::CloudsPlugin;
    pub use bevy_cumulus::settings::*;
}
use bevy::{
    asset::RenderAssetUsages,
    prelude::*,
    render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages},
};
pub mod textures {
    #[derive(bevy::prelude::Resource, Default)]
    pub struct CloudTextureStatus {
        pub baking: bool,
        pub progress: f32,
    }
}
use prelude::*;
pub struct CloudsPlugin;
impl Plugin for CloudsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<textures::CloudTextureStatus>()
            .init_resource::<CloudStatus>()
            .init_resource::<CloudClock>();
    }
}
#[derive(Resource, Default)]
pub struct CloudStatus;
impl CloudStatus {
    pub fn is_ready(&self) -> bool {
        true
    }
    pub fn unsupported(&self) -> Option<&str> {
        None
    }
}
#[derive(Component)]
pub struct CloudBuffer(pub Handle<Image>);
impl CloudBuffer {
    pub fn image(width: u32, height: u32) -> Image {
        let mut i = Image::new_fill(
            Extent3d {
                width,
                height,
                depth_or_array_layers: 1,
            },
            TextureDimension::D2,
            &[0u8; 16],
            TextureFormat::Rgba32Float,
            RenderAssetUsages::RENDER_WORLD,
        );
        i.texture_descriptor.usage |= TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC;
        i
    }
}
