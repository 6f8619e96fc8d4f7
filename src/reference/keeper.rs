//! [`CloudField`] and the plugin that keeps it as the renderer has it.

use bevy::{
    light::{Atmosphere, SunDisk},
    prelude::*,
    render::RenderApp,
    tasks::{AsyncComputeTaskPool, TaskPool},
};
use thiserror::Error;

use super::{
    planet::{Planet, disc_size},
    query::CloudSky,
};
use crate::{
    model::{ModelModule, ZoneAt},
    render::CloudStatus,
    settings::{CloudZone, GoodSettings, KeepGood, Validate},
    textures::{CloudTextureSlot, CloudTextureStatus, cpu_copies::CpuCopies, readback, weather_maps},
};

/// Lets the CPU ask about the clouds: adds [`CloudField`] and keeps it as what is drawn. Add it with
/// [`CloudsPlugin`](crate::CloudsPlugin), before or after.
///
/// Costs, none of them without this plugin: the textures are read back once after each bake or change, a megabyte a
/// frame and without waiting for the GPU, some 80 frames for all at the default sizes; otherwise next to nothing. They
/// take 36 MB of memory at the default sizes: 9.6 MB a volume of 128³, 5.6 MB each for coverage, its bound and the type
/// map at 1024², as f32. With weather-map layers 20 MB more for their volumes; their maps are shared with the renderer.
#[derive(Clone, Copy, Debug, Default)]
pub struct CloudFieldPlugin;

/// The sky for the CPU to ask, in Bevy's main world: see [`CloudSky`]. Added by [`CloudFieldPlugin`].
///
/// It follows settings, clock, sun, planet and textures at the end of each frame: in `Update` it is the sky of the last
/// frame. A changed texture, and a first layer, shows here some frames after it shows on screen; see
/// [`is_current`](Self::is_current). An app that starts with layers has no sky before it has theirs.
///
/// ```no_run
/// # use bevy::prelude::*;
/// use bevy_cumulus::prelude::*;
///
/// fn dim_the_cockpit(sky: Res<CloudField>, camera: Single<&GlobalTransform, With<CloudView>>) {
///     let Ok(sky) = sky.get() else { return }; // not read back yet
///     let here = camera.translation();
///     info!("in cloud: {}, sunlight: {:.2}", sky.is_in_cloud(here), sky.sun_visibility(here));
/// }
/// ```
#[derive(Resource, Clone, Debug)]
pub struct CloudField {
    sky: Result<CloudSky, CloudFieldError>,
    current: bool,
}

/// Why nothing can be said about the clouds.
#[derive(Error, Clone, PartialEq, Debug)]
pub enum CloudFieldError {
    /// The textures are still being baked or read back, or layers' first maps are being made. Wait.
    #[error("the cloud textures are not on the CPU yet")]
    NotReady,
    /// A [`ModelShader`](crate::ModelShader) is in the built-in model's place, and the CPU cannot run it.
    #[error("the clouds are those of a ModelShader, which the CPU cannot run")]
    CustomModel,
    /// An image in a slot can be read neither on the GPU nor in the main world.
    #[error(
        "textures.{slot}: the image cannot be read back: give it `RenderAssetUsages::MAIN_WORLD`, or the texture usage \
         `COPY_SRC`"
    )]
    Unreadable {
        /// The slot.
        slot: CloudTextureSlot,
    },
    /// There are no clouds on this device.
    #[error("there are no clouds: {reason}")]
    Unsupported {
        /// As [`CloudStatus::unsupported`] says.
        reason: String,
    },
}

impl CloudField {
    /// The sky to ask.
    ///
    /// # Errors
    /// Why there is none (yet).
    pub fn get(&self) -> Result<&CloudSky, &CloudFieldError> {
        self.sky.as_ref()
    }

    /// Whether [`get`](Self::get) has a sky.
    pub fn is_ready(&self) -> bool {
        self.sky.is_ok()
    }

    /// Whether its textures are those that are drawn: none is being baked, loaded or read back.
    pub fn is_current(&self) -> bool {
        self.current
    }
}

impl Plugin for CloudFieldPlugin {
    fn build(&self, app: &mut App) {
        let copies = CpuCopies::default();
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            render_app.insert_resource(copies.clone());
        }
        app.insert_resource(copies)
            .insert_resource(CloudField { sky: Err(CloudFieldError::NotReady), current: false })
            .add_systems(
                Last,
                (read_images.run_if(resource_exists::<Assets<Image>>), update_field)
                    .chain()
                    .after(KeepGood)
                    .after(weather_maps::follow_layers),
            );
    }

    fn finish(&self, app: &mut App) {
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            readback::build_render(render_app);
        }
    }
}

/// Reads the images that the GPU cannot give back, off the main thread.
fn read_images(copies: Res<CpuCopies>, images: Res<Assets<Image>>) {
    for request in copies.take_requests() {
        let Some(image) = images.get(request.image).filter(|image| image.data.is_some()) else {
            copies.refuse(&request);
            continue;
        };
        let (image, copies) = (image.clone(), copies.clone());
        let task = async move { copies.read_image(&request, &image) };
        AsyncComputeTaskPool::get_or_init(TaskPool::new).spawn(task).detach();
    }
}

type SunItems =
    (&'static DirectionalLight, &'static GlobalTransform, &'static InheritedVisibility, Option<&'static SunDisk>);
type Suns<'w, 's> = Query<'w, 's, SunItems>;

fn update_field(
    copies: Res<CpuCopies>,
    good: Option<Res<GoodSettings>>,
    (textures, maps): (Option<Res<CloudTextureStatus>>, Option<Res<weather_maps::LayerMaps>>),
    status: Option<Res<CloudStatus>>,
    module: Option<Res<ModelModule>>,
    planets: Query<(&Atmosphere, &GlobalTransform)>,
    zones: Query<(Entity, &CloudZone, &GlobalTransform)>,
    suns: Suns,
    mut field: ResMut<CloudField>,
) {
    let custom = module.is_some_and(|module| module.is_custom);
    let baking = textures.is_none_or(|textures| textures.baking);
    let has_layers = good.as_ref().is_some_and(|good| good.0.layers.shown().next().is_some());
    let maps = maps.as_ref().map(|maps| maps.published());
    let awaits_maps = has_layers && maps.is_none_or(|maps| maps.pending);
    let set = copies.get(has_layers);
    let awaits_layers = has_layers && (awaits_maps || set.as_ref().is_ok_and(|set| set.layers.is_none()));
    field.current = !baking && !awaits_layers && copies.are_current();
    field.sky = (|| {
        if custom {
            return Err(CloudFieldError::CustomModel);
        }
        if let Some(reason) = status.as_ref().and_then(|status| status.unsupported()) {
            return Err(CloudFieldError::Unsupported { reason: reason.to_owned() });
        }
        let mut set = set?;
        let good = &good.as_ref().ok_or(CloudFieldError::NotReady)?.0;
        if let Some(maps) = maps {
            set = set.with_maps(&maps.maps);
        }
        // A sky that is there stays, and layers appear in it as they do on screen.
        if field.sky.is_err() && awaits_layers {
            return Err(CloudFieldError::NotReady);
        }
        let mut sky = match &field.sky {
            Ok(sky) if sky.textures().is(&set) && *sky.model() == good.model && *sky.layers() == good.layers => {
                sky.clone()
            }
            _ => CloudSky::new(good.model.clone(), set)
                .and_then(|sky| sky.with_layers(good.layers.clone()))
                .map_err(|_| CloudFieldError::NotReady)?,
        };
        let offset = good.model.world_offset;
        let planets: Vec<Planet> = planets
            .iter()
            .map(|(atmosphere, at)| Planet::of_atmosphere(at.translation(), atmosphere.inner_radius, offset))
            .collect();
        // The renderer says what is wrong with one.
        let valid = zones.iter().filter(|(_, zone, _)| zone.validate().is_ok());
        let zones = valid.filter_map(|(entity, zone, at)| ZoneAt::new(entity, zone, at.translation(), offset));
        let sun = brightest(&suns);
        sky = sky.with_zones(zones.collect()).with_planets(&planets).at(good.clock.seconds);
        Ok(sky.with_sun(sun.map(|sun| sun.0)).with_sun_size(sun.map_or(0.0, |sun| sun.1)))
    })();
}

/// Direction to the scene's brightest light and its angular diameter (rad), as the renderer takes them.
fn brightest(suns: &Suns) -> Option<(bevy::math::DVec3, f64)> {
    suns.iter()
        .filter(|(_, _, visible, _)| visible.get())
        .map(|(light, at, _, disc)| {
            // Bevy gives a light without one the Earth's.
            let size = disc.map_or(SunDisk::EARTH.angular_size, |disc| disc.angular_size);
            (light.color.to_linear().to_vec3() * light.illuminance, at.back().as_vec3(), size)
        })
        .filter(|(illuminance, direction, _)| illuminance.is_finite() && direction.is_finite())
        .max_by(|a, b| a.0.element_sum().total_cmp(&b.0.element_sum()))
        .map(|(_, direction, size)| (direction.as_dvec3(), disc_size(size).into()))
}
