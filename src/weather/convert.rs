//! Pictures that were painted or loaded, as weather maps.

use bevy::{
    prelude::*,
    render::render_resource::{TextureDimension, TextureFormat},
};
use thiserror::Error;

use super::map::WeatherMap;
use crate::settings::MapChannels;

/// Largest side of a map, in texels.
pub(super) const MAX_SIDE: u32 = 8192;

/// A picture that cannot be a weather map.
#[derive(Error, Clone, PartialEq, Debug)]
pub enum WeatherMapError {
    /// The image's data are on the GPU only.
    #[error("the weather map has no data on the CPU; load it with `RenderAssetUsages::default()`")]
    NoData,
    /// It is not one flat picture.
    #[error("the weather map is {0}; it must be one flat picture")]
    NotFlat(String),
    /// A side is 0 or above 8192 texels.
    #[error("the weather map has {width} × {height} texels; each side must have 1 to 8192")]
    Size {
        /// Texels across.
        width: u32,
        /// Texels down.
        height: u32,
    },
    /// Its texels are compressed, or of a kind that has no meaning here.
    #[error("the weather map's format is {0:?}; it must be one to four channels of 8 or 16 bits, or of floats")]
    Format(TextureFormat),
    /// There are fewer bytes than its size needs.
    #[error("the weather map has {found} bytes of data; its size and format need {needed}")]
    TooShort {
        /// Bytes needed.
        needed: usize,
        /// Bytes there.
        found: usize,
    },
    /// The channel that is to be coverage is not there.
    #[error("the weather map has no {channel} channel: {reason}")]
    MissingChannel {
        /// `green`, `blue` or `alpha`.
        channel: &'static str,
        /// How that shows.
        reason: String,
    },
    /// A number is no share: not from 0 to 1, or not a number.
    #[error("the weather map's {channel} at texel ({x}, {y}) is {value}; it must be from 0 to 1")]
    OutOfRange {
        /// `coverage`, `height` or `base`.
        channel: &'static str,
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// The number found.
        value: f32,
    },
}

/// How a channel is stored.
#[derive(Clone, Copy)]
enum Number {
    Byte,
    Short,
    Half,
    Float,
}

impl Number {
    fn bytes(self) -> usize {
        match self {
            Self::Byte => 1,
            Self::Short | Self::Half => 2,
            Self::Float => 4,
        }
    }

    /// `bytes` are as many as [`bytes`](Self::bytes) says; GPU data are little-endian.
    fn read(self, bytes: &[u8]) -> f32 {
        match (self, bytes) {
            (Self::Byte, &[a]) => f32::from(a) / 255.0,
            (Self::Short, &[a, b]) => f32::from(u16::from_le_bytes([a, b])) / 65535.0,
            (Self::Half, &[a, b]) => half::f16::from_le_bytes([a, b]).to_f32(),
            (Self::Float, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
            _ => f32::NAN,
        }
    }
}

/// Number, channels, and whether blue comes first.
fn layout(format: TextureFormat) -> Option<(Number, usize, bool)> {
    use TextureFormat as F;
    Some(match format {
        F::R8Unorm | F::R8Uint => (Number::Byte, 1, false),
        F::Rg8Unorm | F::Rg8Uint => (Number::Byte, 2, false),
        F::Rgba8Unorm | F::Rgba8UnormSrgb | F::Rgba8Uint => (Number::Byte, 4, false),
        F::Bgra8Unorm | F::Bgra8UnormSrgb => (Number::Byte, 4, true),
        F::R16Unorm | F::R16Uint => (Number::Short, 1, false),
        F::Rg16Unorm | F::Rg16Uint => (Number::Short, 2, false),
        F::Rgba16Unorm | F::Rgba16Uint => (Number::Short, 4, false),
        F::R16Float => (Number::Half, 1, false),
        F::Rg16Float => (Number::Half, 2, false),
        F::Rgba16Float => (Number::Half, 4, false),
        F::R32Float => (Number::Float, 1, false),
        F::Rg32Float => (Number::Float, 2, false),
        F::Rgba32Float => (Number::Float, 4, false),
        _ => return None,
    })
}

/// The texels of a picture that can be read.
struct Picture<'a> {
    size: UVec2,
    data: &'a [u8],
    number: Number,
    channels: usize,
    blue_first: bool,
}

impl<'a> Picture<'a> {
    fn new(image: &'a Image) -> Result<Self, WeatherMapError> {
        let descriptor = &image.texture_descriptor;
        let (width, height) = (descriptor.size.width, descriptor.size.height);
        if descriptor.dimension != TextureDimension::D2 {
            return Err(WeatherMapError::NotFlat(format!("{:?}", descriptor.dimension)));
        }
        if descriptor.size.depth_or_array_layers != 1 {
            return Err(WeatherMapError::NotFlat(format!("{} pictures", descriptor.size.depth_or_array_layers)));
        }
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            return Err(WeatherMapError::Size { width, height });
        }
        let (number, channels, blue_first) =
            layout(descriptor.format).ok_or(WeatherMapError::Format(descriptor.format))?;
        let data = image.data.as_ref().ok_or(WeatherMapError::NoData)?;
        let needed = number.bytes() * channels * width as usize * height as usize;
        let data = data.get(..needed).ok_or(WeatherMapError::TooShort { needed, found: data.len() })?;
        Ok(Self { size: UVec2::new(width, height), data, number, channels, blue_first })
    }

    fn stride(&self) -> usize {
        self.number.bytes() * self.channels
    }

    /// Channels that the picture lacks are as in a map of full height and the lowest base.
    fn texels(&self) -> impl Iterator<Item = [f32; 4]> {
        self.data.chunks_exact(self.stride()).map(|bytes| {
            let mut texel = [0.0, 1.0, 0.0, 1.0];
            for (channel, bytes) in texel.iter_mut().zip(bytes.chunks_exact(self.number.bytes())) {
                *channel = self.number.read(bytes);
            }
            if self.blue_first {
                texel.swap(0, 2);
            }
            texel
        })
    }
}

/// Size and red channel of a picture.
pub(super) fn picture_channel(image: &Image) -> Result<(UVec2, Vec<f32>), WeatherMapError> {
    let picture = Picture::new(image)?;
    Ok((picture.size, picture.texels().map(|[red, ..]| red).collect()))
}

impl WeatherMap {
    /// Takes a map from a picture, as Bevy loads PNG, KTX2 (not compressed), EXR or HDR files where its features for them are
    /// on: the first mip level of one to four channels of 8 or 16 bits, or of floats from 0 to 1.
    ///
    /// Numbers are taken as they were painted, whether or not the picture is marked as sRGB. Where height or base is missing,
    /// cloud has full height and its base lies at the bottom; that holds too for a picture that is grey all over, which is
    /// how Bevy loads grey PNGs.
    ///
    /// # Errors
    /// What is wrong with the picture, with the place where it is.
    pub fn from_image(image: &Image) -> Result<Self, WeatherMapError> {
        let picture = Picture::new(image)?;
        let mut texels = Vec::with_capacity(picture.data.len() / picture.stride());
        for (n, texel) in picture.texels().enumerate() {
            check_shares(texel, n, picture.size.x)?;
            texels.push(texel.map(to_byte));
        }
        if picture.channels > 2 && texels.iter().all(|[r, g, b, _]| r == g && g == b) {
            texels.iter_mut().for_each(|texel| *texel = [texel[0], 255, 0, 255]);
        }
        Ok(Self::from_texels(picture.size, texels))
    }

    /// As [`from_image`](Self::from_image), with what a layer reads of it: all, or one channel as coverage, for cloud of full
    /// height with its base at the bottom. Of the other channels nothing is asked then.
    ///
    /// # Errors
    /// What is wrong with the picture, and [`WeatherMapError::MissingChannel`] where it has no such channel. An alpha that is
    /// full everywhere counts as none: pictures without alpha are loaded so.
    pub fn from_image_channels(image: &Image, channels: MapChannels) -> Result<Self, WeatherMapError> {
        let (k, name) = match channels {
            MapChannels::Rgb => return Self::from_image(image),
            MapChannels::Red => (0, "red"),
            MapChannels::Green => (1, "green"),
            MapChannels::Blue => (2, "blue"),
            MapChannels::Alpha => (3, "alpha"),
        };
        let missing = |reason: String| WeatherMapError::MissingChannel { channel: name, reason };
        let picture = Picture::new(image)?;
        if k >= picture.channels {
            return Err(missing(format!("its format is {:?}", image.texture_descriptor.format)));
        }
        let mut texels = Vec::with_capacity(picture.data.len() / picture.stride());
        for (n, texel) in picture.texels().enumerate() {
            let chosen = [texel[k], 1.0, 0.0, 1.0];
            check_shares(chosen, n, picture.size.x)?;
            texels.push(chosen.map(to_byte));
        }
        if k == 3 && texels.iter().all(|texel| texel[0] == 255) {
            return Err(missing("it is full everywhere, as that of pictures without one is".to_owned()));
        }
        Ok(Self::from_texels(picture.size, texels))
    }
}

/// Whether coverage, height and base are from 0 to 1. Alpha is free, so anything goes there.
fn check_shares(texel: [f32; 4], n: usize, width: u32) -> Result<(), WeatherMapError> {
    // Half a step of a byte: what a filter or a colour space may have added.
    let slack = 0.5 / 255.0;
    for (channel, value) in ["coverage", "height", "base"].into_iter().zip(texel) {
        if !(-slack..=1.0 + slack).contains(&value) {
            let (x, y) = (n as u32 % width, n as u32 / width);
            return Err(WeatherMapError::OutOfRange { channel, x, y, value });
        }
    }
    Ok(())
}

fn to_byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}
