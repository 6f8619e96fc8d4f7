//! The render half: decides what each slot shows, bakes what is missing a little each frame, and swaps it in when done.

use std::sync::atomic::Ordering::Relaxed;

use bevy::{
    asset::AssetId,
    prelude::*,
    render::{
        Extract,
        render_asset::RenderAssets,
        render_resource::{PipelineCache, Texture, TextureView, TextureViewDescriptor},
        renderer::{RenderAdapterInfo, RenderContext, RenderDevice, RenderQueue},
        texture::GpuImage,
    },
};

use super::{
    job::{Job, Tools},
    pipelines::BakePipelines,
    progress::Progress,
    recipe::Recipe,
    slots::{CloudTextureSlot, SlotStates, check_descriptor},
};
use crate::settings::{CloudTextures, CloudWeather, GoodSettings, MAX_LAYERS};

/// Most work that baking does in one frame on a software rasteriser, in texel-octaves: one texel of one octave of 3D
/// Worley noise, or what takes as long. Measured at 10 to 30 ms with Mesa's lavapipe on two cores.
///
/// On a GPU a frame may do [`GPU_FRAMES`] times as much. It must hold one slice of the largest volume, 256² × 6 octaves.
pub const TEXEL_OCTAVES_PER_FRAME: u32 = 800_000;

/// How much more than [`TEXEL_OCTAVES_PER_FRAME`] one frame does on a GPU. Estimated, not measured: any GPU should be tens
/// of times as fast as the software rasteriser, which makes this a few milliseconds at most.
pub const GPU_FRAMES: u32 = 8;

/// What the main world asks for.
#[derive(Resource, Clone, PartialEq, Default)]
pub(super) struct Wanted {
    settings: Option<CloudTextures>,
    /// Whether there are weather-map layers.
    layers: bool,
    /// The image of each slot that has a good one, with the count of its changes.
    images: [Option<(AssetId<Image>, u32)>; CloudTextureSlot::COUNT],
}

impl Wanted {
    fn content(&self, slot: CloudTextureSlot) -> Option<Content> {
        if slot.is_of_layers() && !self.layers {
            return None;
        }
        let image = self.images[slot as usize];
        match (image, slot) {
            (Some((image, revision)), CloudTextureSlot::Coverage | CloudTextureSlot::TypeMap) => {
                Some(Content::Made(Recipe::Pyramid { image, revision }))
            }
            (Some((image, revision)), _) => Some(Content::Image { image, revision }),
            (None, _) => Recipe::baked(slot, self.settings.as_ref()?).map(Content::Made),
        }
    }
}

pub(super) fn extract(
    good: Extract<Res<GoodSettings>>,
    weather: Extract<Option<Res<CloudWeather>>>,
    slots: Extract<Res<SlotStates>>,
    shared: Extract<Res<Progress>>,
    mut progress: ResMut<Progress>,
    mut wanted: ResMut<Wanted>,
) {
    if !std::sync::Arc::ptr_eq(&shared.0, &progress.0) {
        *progress = shared.clone();
        progress.0.enabled.store(true, Relaxed);
        progress.0.ask();
    }
    // A sky that is to come has its volumes when it comes.
    let is_ahead = weather.as_ref().is_some_and(|weather| weather.layers_ahead(good.0.clock.seconds).next().is_some());
    let now = Wanted {
        settings: Some(good.0.textures.clone()),
        layers: good.0.layers.shown().next().is_some() || is_ahead,
        images: slots.images(),
    };
    if *wanted != now {
        *wanted = now;
        progress.0.ask();
    }
}

/// What a slot shows, as far as one can tell two of them apart.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum Content {
    Made(Recipe),
    Image { image: AssetId<Image>, revision: u32 },
}

struct Bound {
    content: Content,
    texture: Texture,
    view: TextureView,
}

/// The textures the model reads. Views are `None` until there is something to show; [`generation`](Self::generation) changes
/// whenever any of them does.
#[derive(Resource, Default)]
pub(crate) struct CloudTextureViews {
    /// Noise volume, rgba: fBm of inverted Worley noise from four first octaves.
    pub billow: Option<TextureView>,
    /// Noise volume, rgba: fBm of Perlin noise from four first octaves.
    pub wisp: Option<TextureView>,
    /// Pyramid: r the coverage, g its bound.
    pub coverage: Option<TextureView>,
    /// Pyramid: r the type, g its bound.
    pub type_map: Option<TextureView>,
    /// r the vertical profile; x the type, y the height.
    pub gradient: Option<TextureView>,
    /// rgb three independent channels; a texel t in \[0, 1\] stands for `t * 255/256 + 0.5/256`.
    pub blue_noise: Option<TextureView>,
    /// Noise volumes of weather-map layers; not there before there is one.
    pub shape: Option<TextureView>,
    pub detail: Option<TextureView>,
    /// Weather maps of the layers, an array; which layers have theirs, and its side in texels.
    pub weather: Option<TextureView>,
    pub weather_layers: [bool; MAX_LAYERS],
    pub weather_size: u32,
    /// Whether more of them are to come.
    pub maps_pending: bool,
    /// Whether anything is still to be baked or loaded.
    pub bake_pending: bool,
    /// Whether there are layers.
    pub layers_wanted: bool,
    /// Rg a curl field, b fibres, a cells.
    pub swirl: Option<TextureView>,
    pub generation: u64,
}

impl CloudTextureViews {
    pub(crate) fn is_ready(&self) -> bool {
        [&self.billow, &self.wisp, &self.coverage, &self.type_map, &self.gradient, &self.blue_noise]
            .iter()
            .all(|view| view.is_some())
    }

    fn set(&mut self, slot: CloudTextureSlot, view: TextureView) {
        self.generation += 1;
        let place = match slot {
            CloudTextureSlot::Billow => &mut self.billow,
            CloudTextureSlot::Wisp => &mut self.wisp,
            CloudTextureSlot::Coverage => &mut self.coverage,
            CloudTextureSlot::TypeMap => &mut self.type_map,
            CloudTextureSlot::Gradient => &mut self.gradient,
            CloudTextureSlot::BlueNoise => &mut self.blue_noise,
            CloudTextureSlot::Shape => &mut self.shape,
            CloudTextureSlot::Detail => &mut self.detail,
        };
        *place = Some(view);
    }
}

/// All GPU state of the bake. Made anew with each device, so that a lost one is baked for again.
#[derive(Resource)]
pub(crate) struct Bakery {
    bound: [Option<Bound>; CloudTextureSlot::COUNT],
    job: Option<Job>,
    /// Work of the bake under way when it was largest; 0 when there is none.
    session: u64,
    budget: u32,
}

impl Bakery {
    /// The texture that a slot shows.
    pub(crate) fn texture(&self, slot: CloudTextureSlot) -> Option<&Texture> {
        self.bound[slot as usize].as_ref().map(|bound| &bound.texture)
    }

    /// The texture that a slot shows, and what tells it from others.
    pub(super) fn shown(&self, slot: CloudTextureSlot) -> Option<(&Content, &Texture)> {
        self.bound[slot as usize].as_ref().map(|bound| (&bound.content, &bound.texture))
    }

    fn shows(&self, slot: CloudTextureSlot, content: &Content) -> bool {
        self.bound[slot as usize].as_ref().is_some_and(|bound| bound.content == *content)
    }

    fn show(&mut self, slot: CloudTextureSlot, bound: Bound, views: &mut CloudTextureViews) {
        views.set(slot, bound.view.clone());
        self.bound[slot as usize] = Some(bound);
    }

    /// Shows what has been completed, and drops what nobody wants any more.
    fn collect(&mut self, wanted: &Wanted, views: &mut CloudTextureViews) {
        let Some(job) = self.job.take() else { return };
        let content = Content::Made(job.recipe.clone());
        if wanted.content(job.slot).as_ref() != Some(&content) {
            return;
        }
        if job.is_complete() {
            let view = job.texture.create_view(&TextureViewDescriptor::default());
            self.show(job.slot, Bound { content, texture: job.texture, view }, views);
        } else {
            self.job = Some(job);
        }
    }

    /// Work left: the job's, and all of what has not been started.
    fn remaining(&self, wanted: &Wanted, images: &RenderAssets<GpuImage>) -> u64 {
        CloudTextureSlot::BAKE_ORDER
            .into_iter()
            .filter_map(|slot| match (wanted.content(slot)?, &self.job) {
                (_, Some(job)) if job.slot == slot => Some(job.remaining()),
                (content, _) if self.shows(slot, &content) => None,
                (Content::Made(recipe), _) => {
                    let size = source(&recipe, slot, images).map_or(UVec2::ONE, |(_, size)| size);
                    Some(recipe.plan(size).cost())
                }
                (Content::Image { .. }, _) => None,
            })
            .sum()
    }
}

impl FromWorld for Bakery {
    fn from_world(world: &mut World) -> Self {
        let is_gpu =
            world.get_resource::<RenderAdapterInfo>().is_some_and(|info| info.device_type != wgpu::DeviceType::Cpu);
        let budget = TEXEL_OCTAVES_PER_FRAME * if is_gpu { GPU_FRAMES } else { 1 };
        // Whoever holds views of a lost device has to notice: the count goes on.
        let generation = world.get_resource::<CloudTextureViews>().map_or(0, |views| views.generation + 1);
        world.insert_resource(CloudTextureViews { generation, ..default() });
        let progress = world.resource::<Progress>();
        progress.0.ask();
        Self { bound: default(), job: None, session: 0, budget }
    }
}

/// The user's image that a pyramid is built over, and its size, once it is on the GPU.
fn source(recipe: &Recipe, slot: CloudTextureSlot, images: &RenderAssets<GpuImage>) -> Option<(TextureView, UVec2)> {
    let Recipe::Pyramid { image, .. } = recipe else {
        return None;
    };
    let image = usable(slot, *image, images)?;
    Some((image.texture_view.clone(), image.size_2d()))
}

/// An image on the GPU, if it is what the slot needs. What the main world checked may have been replaced since.
fn usable(slot: CloudTextureSlot, id: AssetId<Image>, images: &RenderAssets<GpuImage>) -> Option<&GpuImage> {
    let image = images.get(id)?;
    check_descriptor(slot, &image.texture_descriptor).is_ok().then_some(image)
}

/// Brings what the slots show closer to what is wanted, short of baking.
pub(super) fn plan(
    wanted: Res<Wanted>,
    images: Res<RenderAssets<GpuImage>>,
    device: Res<RenderDevice>,
    progress: Res<Progress>,
    mut bakery: ResMut<Bakery>,
    mut views: ResMut<CloudTextureViews>,
) {
    bakery.collect(&wanted, &mut views);
    let mut satisfied = true;
    for slot in CloudTextureSlot::BAKE_ORDER {
        let Some(content) = wanted.content(slot) else {
            continue;
        };
        if bakery.shows(slot, &content) {
            continue;
        }
        match content {
            Content::Image { image, .. } => match usable(slot, image, &images) {
                Some(gpu) => {
                    let bound = Bound { content, texture: gpu.texture.clone(), view: gpu.texture_view.clone() };
                    bakery.show(slot, bound, &mut views);
                }
                None => satisfied = false,
            },
            Content::Made(recipe) => {
                satisfied = false;
                let image = source(&recipe, slot, &images);
                if bakery.job.is_none() && (image.is_some() || !matches!(recipe, Recipe::Pyramid { .. })) {
                    bakery.job = Some(Job::start(slot, recipe, image, &device));
                }
            }
        }
    }
    views.bake_pending = !satisfied;
    views.layers_wanted = wanted.layers;
    report(&mut bakery, satisfied, &wanted, &images, &progress);
}

fn report(bakery: &mut Bakery, satisfied: bool, wanted: &Wanted, images: &RenderAssets<GpuImage>, progress: &Progress) {
    let cells = &progress.0;
    cells.frame_budget.store(bakery.budget, Relaxed);
    if satisfied {
        bakery.session = 0;
        cells.finish();
        return;
    }
    if bakery.session == 0 {
        cells.start_counting();
    }
    let remaining = bakery.remaining(wanted, images);
    bakery.session = bakery.session.max(remaining).max(1);
    cells.set_share(1.0 - remaining as f32 / bakery.session as f32);
}

/// Records this frame's share of the work.
pub(super) fn bake(
    mut bakery: ResMut<Bakery>,
    pipelines: Res<BakePipelines>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    progress: Res<Progress>,
    mut context: RenderContext,
) {
    let budget = u64::from(bakery.budget);
    let Some(job) = bakery.job.as_mut() else {
        return;
    };
    let tools = Tools { device: &device, queue: &queue, cache: &cache, pipelines: &pipelines };
    if job.is_complete() || !job.is_ready(&tools) {
        return;
    }
    let spent = job.record(budget, &tools, context.command_encoder());
    progress.0.count_frame(spent);
}
