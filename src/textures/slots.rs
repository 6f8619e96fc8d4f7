//! Slots for a user's own images: checked when they change, and kept only if good.

use std::ops::RangeInclusive;

use bevy::{
    asset::{AssetId, AssetPath, LoadState, RenderAssetUsages},
    image::{CompressedImageFormats, ImageSampler, ImageType},
    prelude::*,
    render::render_resource::{TextureDescriptor, TextureDimension, TextureFormat, TextureUsages},
};
use thiserror::Error;

use super::recipe::MAX_MAP_SIZE;
use crate::settings::CloudTextureSlots;

/// A field of [`CloudTextureSlots`].
#[derive(Reflect, Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum CloudTextureSlot {
    /// [`CloudTextureSlots::billow`].
    Billow,
    /// [`CloudTextureSlots::wisp`].
    Wisp,
    /// [`CloudTextureSlots::coverage`].
    Coverage,
    /// [`CloudTextureSlots::type_map`].
    TypeMap,
    /// [`CloudTextureSlots::gradient`].
    Gradient,
    /// [`CloudTextureSlots::blue_noise`].
    BlueNoise,
    /// [`CloudTextureSlots::shape`].
    Shape,
    /// [`CloudTextureSlots::detail`].
    Detail,
}

impl std::fmt::Display for CloudTextureSlot {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            Self::Billow => "billow",
            Self::Wisp => "wisp",
            Self::Coverage => "coverage",
            Self::TypeMap => "type_map",
            Self::Gradient => "gradient",
            Self::BlueNoise => "blue_noise",
            Self::Shape => "shape",
            Self::Detail => "detail",
        })
    }
}

impl CloudTextureSlot {
    pub(crate) const COUNT: usize = 8;

    /// All slots, the quick ones first.
    pub(super) const BAKE_ORDER: [Self; Self::COUNT] = [
        Self::BlueNoise,
        Self::Gradient,
        Self::Coverage,
        Self::TypeMap,
        Self::Detail,
        Self::Billow,
        Self::Wisp,
        Self::Shape,
    ];

    /// Those that say where cloud is.
    pub(crate) const OF_MODEL: [Self; 5] = [Self::Gradient, Self::Coverage, Self::TypeMap, Self::Billow, Self::Wisp];

    /// Those that weather-map layers read.
    pub(crate) const OF_LAYERS: [Self; 2] = [Self::Shape, Self::Detail];

    fn handle(self, slots: &CloudTextureSlots) -> Option<&Handle<Image>> {
        match self {
            Self::Billow => &slots.billow,
            Self::Wisp => &slots.wisp,
            Self::Coverage => &slots.coverage,
            Self::TypeMap => &slots.type_map,
            Self::Gradient => &slots.gradient,
            Self::BlueNoise => &slots.blue_noise,
            Self::Shape => &slots.shape,
            Self::Detail => &slots.detail,
        }
        .as_ref()
    }

    fn is_volume(self) -> bool {
        matches!(self, Self::Billow | Self::Wisp) || self.is_of_layers()
    }

    /// Whether only weather-map layers read it: it is not baked before there is one.
    pub(super) fn is_of_layers(self) -> bool {
        matches!(self, Self::Shape | Self::Detail)
    }

    /// Formats that can be filtered on every device and have the channels that are read.
    fn formats(self) -> &'static [TextureFormat] {
        use TextureFormat::{R8Unorm, R16Float, Rg8Unorm, Rg16Float, Rgba8Unorm, Rgba16Float};
        match self {
            Self::Billow | Self::Wisp | Self::BlueNoise | Self::Shape | Self::Detail => &[Rgba8Unorm, Rgba16Float],
            _ => &[R8Unorm, Rg8Unorm, Rgba8Unorm, R16Float, Rg16Float, Rgba16Float],
        }
    }

    /// Sides that are allowed, in texels.
    fn sizes(self) -> RangeInclusive<u32> {
        match self {
            Self::Billow | Self::Wisp | Self::Shape | Self::Detail => 4..=512,
            Self::Coverage | Self::TypeMap => 4..=MAX_MAP_SIZE,
            Self::Gradient => 2..=4096,
            Self::BlueNoise => 4..=1024,
        }
    }
}

/// Why an image cannot be used. What is wrong is logged and sent as this message; the last good texture stays.
#[derive(Message, Error, Clone, PartialEq, Debug)]
#[error("textures.{slot}: {file} {fault}")]
pub struct CloudTextureError {
    /// The slot that the image was put in.
    pub slot: CloudTextureSlot,
    /// Path of the image's file, or "an image made in code".
    pub file: String,
    /// What is wrong and what is allowed.
    pub fault: CloudTextureFault,
}

/// What is wrong with an image.
#[derive(Error, Clone, PartialEq, Debug)]
pub enum CloudTextureFault {
    /// It could not be read or decoded.
    #[error("did not load: {reason}")]
    NotLoaded {
        /// The loader's own words.
        reason: String,
    },
    /// It is flat and should be a volume, or the other way round.
    #[error("is {found}, but must be {expected}")]
    Dimension {
        /// What it is.
        found: &'static str,
        /// What it must be.
        expected: &'static str,
    },
    /// Its texels cannot be filtered on every device, are not linear, or lack channels.
    #[error("has format {found:?}, but must have one of {allowed:?}{hint}")]
    Format {
        /// Its format.
        found: TextureFormat,
        /// The formats that are allowed.
        allowed: &'static [TextureFormat],
        /// What may help.
        hint: &'static str,
    },
    /// A side is too short or too long.
    #[error("is {size} texels, but every side must be {min} to {max}")]
    Size {
        /// Width, height and depth.
        size: UVec3,
        /// Shortest side allowed.
        min: u32,
        /// Longest side allowed.
        max: u32,
    },
    /// It never reaches the GPU in a form that shaders can read.
    #[error("cannot be read by shaders: {reason}")]
    NotOnGpu {
        /// What has to be set.
        reason: &'static str,
    },
}

/// Checks what the GPU will see of an image.
pub(super) fn check_descriptor(
    slot: CloudTextureSlot,
    descriptor: &TextureDescriptor,
) -> Result<(), CloudTextureFault> {
    let size = descriptor.size;
    let found = match descriptor.dimension {
        TextureDimension::D3 => "a 3D image",
        TextureDimension::D2 if size.depth_or_array_layers == 1 => "a 2D image",
        TextureDimension::D2 => "an array of 2D images",
        TextureDimension::D1 => "a 1D image",
    };
    let expected = if slot.is_volume() { "a 3D image" } else { "a 2D image" };
    if found != expected {
        return Err(CloudTextureFault::Dimension { found, expected });
    }
    let (format, allowed) = (descriptor.format, slot.formats());
    if !allowed.contains(&format) {
        let hint = if format.is_srgb() { "; load it as data, with `ImageLoaderSettings::is_srgb = false`" } else { "" };
        return Err(CloudTextureFault::Format { found: format, allowed, hint });
    }
    let sides = UVec3::new(size.width, size.height, size.depth_or_array_layers);
    let checked = if slot.is_volume() { sides } else { sides.with_z(sides.x) };
    let (min, max) = slot.sizes().into_inner();
    if checked.min_element() < min || checked.max_element() > max {
        return Err(CloudTextureFault::Size { size: sides, min, max });
    }
    Ok(())
}

fn check(slot: CloudTextureSlot, image: &Image) -> Result<(), CloudTextureFault> {
    check_descriptor(slot, &image.texture_descriptor)?;
    let reason = if !image.asset_usage.contains(RenderAssetUsages::RENDER_WORLD) {
        "its `asset_usage` lacks `RENDER_WORLD`"
    } else if !image.texture_descriptor.usage.contains(TextureUsages::TEXTURE_BINDING) {
        "its `texture_descriptor.usage` lacks `TEXTURE_BINDING`"
    } else if image.texture_view_descriptor.is_some() {
        "its `texture_view_descriptor` must be `None`"
    } else {
        return Ok(());
    };
    Err(CloudTextureFault::NotOnGpu { reason })
}

/// What is known of each slot's image.
#[derive(Resource, Default)]
pub(super) struct SlotStates {
    states: [SlotState; CloudTextureSlot::COUNT],
    /// The blue noise that ships with the crate.
    shipped: Option<Handle<Image>>,
    /// Whether an image is on its way from disk.
    pub loading: bool,
}

#[derive(Default)]
struct SlotState {
    wanted: Option<AssetId<Image>>,
    /// The last good image, kept alive.
    good: Option<Handle<Image>>,
    /// Counts changes of `good` and of what is in it.
    revision: u32,
    /// Whether what is in `wanted` has been looked at.
    checked: bool,
    /// Whether the failure to load has been told.
    failed: bool,
}

impl SlotStates {
    pub(super) fn images(&self) -> [Option<(AssetId<Image>, u32)>; CloudTextureSlot::COUNT] {
        let mut images: [_; CloudTextureSlot::COUNT] =
            std::array::from_fn(|i| self.states[i].good.as_ref().map(|good| (good.id(), self.states[i].revision)));
        let blue_noise = &mut images[CloudTextureSlot::BlueNoise as usize];
        *blue_noise = blue_noise.or(self.shipped.as_ref().map(|shipped| (shipped.id(), 0)));
        images
    }
}

/// Decodes the shipped blue noise.
pub(super) fn load_blue_noise(mut images: ResMut<Assets<Image>>, mut slots: ResMut<SlotStates>) {
    let png = include_bytes!("../../assets/textures/blue_noise.png");
    // It is kept in the main world too, so that it survives the loss of a device.
    let decoded = Image::from_buffer(
        png,
        ImageType::Extension("png"),
        CompressedImageFormats::NONE,
        false,
        ImageSampler::nearest(),
        RenderAssetUsages::all(),
    );
    match decoded {
        Ok(mut image) => {
            image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
            slots.shipped = Some(images.add(image));
        }
        Err(error) => error!("clouds: the shipped blue noise cannot be decoded: {error}"),
    }
}

/// Looks at slots and images that have changed.
pub(super) fn check_slots(
    slots: Option<Res<CloudTextureSlots>>,
    images: Res<Assets<Image>>,
    server: Res<AssetServer>,
    mut states: ResMut<SlotStates>,
    mut changes: MessageReader<AssetEvent<Image>>,
    mut errors: MessageWriter<CloudTextureError>,
) {
    let changed: Vec<AssetId<Image>> = changes
        .read()
        .filter_map(|change| match change {
            AssetEvent::Added { id } | AssetEvent::Modified { id } => Some(*id),
            _ => None,
        })
        .collect();
    let mut loading = false;
    for slot in CloudTextureSlot::BAKE_ORDER {
        let handle = slots.as_ref().and_then(|slots| slot.handle(slots));
        let state = &mut states.states[slot as usize];
        let load = handle.map(|handle| server.load_state(handle.id()));
        for fault in state.update(slot, handle, load.as_ref(), &images, &changed) {
            let path = handle.and_then(|handle| server.get_path(handle.id()));
            let file = path.as_ref().map_or_else(|| "an image made in code".into(), AssetPath::to_string);
            let error = CloudTextureError { slot, file, fault };
            error!("clouds: {error}; the last good texture stays");
            errors.write(error);
        }
        loading |= !state.checked && matches!(load, Some(LoadState::Loading));
    }
    if states.loading != loading {
        states.loading = loading;
    }
}

impl SlotState {
    /// Takes the image that a slot holds, if it is good; returns what is wrong with it if it is not.
    fn update(
        &mut self,
        slot: CloudTextureSlot,
        handle: Option<&Handle<Image>>,
        load: Option<&LoadState>,
        images: &Assets<Image>,
        changed: &[AssetId<Image>],
    ) -> Vec<CloudTextureFault> {
        let mut faults = Vec::new();
        let wanted = handle.map(Handle::id);
        if self.wanted != wanted {
            (self.wanted, self.checked, self.failed) = (wanted, false, false);
        }
        let Some(handle) = handle else {
            (self.good, self.checked) = (None, true);
            return faults;
        };
        if changed.contains(&handle.id()) {
            self.checked = false;
        }
        if !self.checked
            && let Some(image) = images.get(handle)
        {
            self.checked = true;
            match check(slot, image) {
                Ok(()) => {
                    self.good = Some(handle.clone());
                    self.revision += 1;
                }
                Err(fault) => faults.push(fault),
            }
        } else if let Some(good) = self.good.as_ref().filter(|good| *good != handle)
            && changed.contains(&good.id())
            && images.get(good).is_some_and(|image| check(slot, image).is_ok())
        {
            self.revision += 1;
        }
        match load {
            Some(LoadState::Failed(error)) if !self.failed => {
                (self.failed, self.checked) = (true, true);
                faults.push(CloudTextureFault::NotLoaded { reason: error.to_string() });
            }
            Some(LoadState::Loaded) => self.failed = false,
            _ => {}
        }
        faults
    }
}
