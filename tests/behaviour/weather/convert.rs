//! Pictures as maps, and maps as pictures.

use bevy::{
    asset::RenderAssetUsages,
    image::{ImageAddressMode, ImageSampler, ImageType},
    prelude::*,
    render::render_resource::{Extent3d, TextureDimension, TextureFormat},
};
use bevy_cumulus::{prelude::*, settings::MapChannels, weather::WeatherMapError};
use image::{DynamicImage, GrayImage, ImageBuffer, ImageFormat, Rgba, RgbaImage};

use super::{made, small};

/// A picture of 2 × 1 texels of this format.
fn picture(format: TextureFormat, data: &[u8]) -> Image {
    let size = Extent3d { width: 2, height: 1, depth_or_array_layers: 1 };
    Image::new(size, TextureDimension::D2, data.to_vec(), format, RenderAssetUsages::default())
}

#[test]
fn a_map_survives_as_an_image() {
    let map = made(&small());
    let image = map.to_image();
    assert_eq!(image.texture_descriptor.format, TextureFormat::Rgba8Unorm);
    assert_eq!(image.size(), map.size());
    let ImageSampler::Descriptor(sampler) = &image.sampler else { panic!("no sampler of its own") };
    let modes = [sampler.address_mode_u, sampler.address_mode_v];
    assert!(modes.iter().all(|mode| matches!(mode, ImageAddressMode::Repeat)));
    assert!(WeatherMap::from_image(&image).unwrap() == map);
}

fn shorts(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// 0, 0.25, 0.5 and 1 as half floats.
const HALVES: [u16; 4] = [0, 0x3400, 0x3800, 0x3c00];

#[test]
fn every_usual_format_is_read() {
    use TextureFormat as F;
    let bytes = [51, 102, 0, 255, 255, 0, 204, 7];
    let full = [[51, 102, 0, 255], [255, 0, 204, 7]];
    for format in [F::Rgba8Unorm, F::Rgba8UnormSrgb, F::Rgba8Uint] {
        assert_eq!(WeatherMap::from_image(&picture(format, &bytes)).unwrap().texels(), full, "{format:?}");
    }
    let swapped = [0, 102, 51, 255, 204, 0, 255, 7];
    for format in [F::Bgra8Unorm, F::Bgra8UnormSrgb] {
        assert_eq!(WeatherMap::from_image(&picture(format, &swapped)).unwrap().texels(), full, "{format:?}");
    }
    let long: Vec<u16> = bytes.iter().map(|&b| u16::from(b) * 257).collect();
    for format in [F::Rgba16Unorm, F::Rgba16Uint] {
        assert_eq!(WeatherMap::from_image(&picture(format, &shorts(&long))).unwrap().texels(), full, "{format:?}");
    }
    let real: Vec<f32> = bytes.iter().map(|&b| f32::from(b) / 255.0).collect();
    assert_eq!(WeatherMap::from_image(&picture(F::Rgba32Float, &floats(&real))).unwrap().texels(), full);
    let half = [HALVES, HALVES].concat();
    let found = WeatherMap::from_image(&picture(F::Rgba16Float, &shorts(&half))).unwrap();
    assert_eq!(found.texels(), [[0, 64, 128, 255]; 2]);
}

#[test]
fn missing_channels_mean_full_height_and_the_lowest_base() {
    use TextureFormat as F;
    for (format, data) in [
        (F::R8Unorm, vec![0, 255]),
        (F::R16Unorm, shorts(&[0, 65535])),
        (F::R16Float, shorts(&[0, 0x3c00])),
        (F::R32Float, floats(&[0.0, 1.0])),
        // As Bevy loads a grey PNG.
        (F::Rgba8UnormSrgb, vec![0, 0, 0, 255, 255, 255, 255, 255]),
    ] {
        let map = WeatherMap::from_image(&picture(format, &data)).unwrap();
        assert_eq!(map.texels(), [[0, 255, 0, 255], [255, 255, 0, 255]], "{format:?}");
    }
    for (format, data) in [
        (F::Rg8Unorm, vec![0, 255, 255, 0]),
        (F::Rg16Unorm, shorts(&[0, 65535, 65535, 0])),
        (F::Rg16Float, shorts(&[0, 0x3c00, 0x3c00, 0])),
        (F::Rg32Float, floats(&[0.0, 1.0, 1.0, 0.0])),
    ] {
        let map = WeatherMap::from_image(&picture(format, &data)).unwrap();
        assert_eq!(map.texels(), [[0, 255, 0, 255], [255, 0, 0, 255]], "{format:?}");
    }
}

#[test]
fn one_channel_is_coverage_before_anything_is_filled_in() {
    use MapChannels as C;
    use TextureFormat as F;
    let read = |image: &Image, channels| WeatherMap::from_image_channels(image, channels);
    let coverage = |image: &Image, channels| {
        let map = read(image, channels).unwrap_or_else(|error| panic!("{channels:?}: {error}"));
        assert!(map.texels().iter().all(|[_, height, base, free]| [*height, *base, *free] == [255, 0, 255]));
        map.texels().iter().map(|texel| texel[0]).collect::<Vec<_>>()
    };
    let all = [C::Red, C::Green, C::Blue, C::Alpha];
    let colours = picture(F::Rgba8Unorm, &[10, 20, 30, 40, 50, 60, 70, 80]);
    assert_eq!(all.map(|c| coverage(&colours, c)), [[10, 50], [20, 60], [30, 70], [40, 80]]);
    assert!(read(&colours, C::Rgb).unwrap() == WeatherMap::from_image(&colours).unwrap());
    let swapped = picture(F::Bgra8Unorm, &[30, 20, 10, 40, 70, 60, 50, 80]);
    assert_eq!(all.map(|c| coverage(&swapped, c)), [[10, 50], [20, 60], [30, 70], [40, 80]]);
    // Grey, with something else in alpha.
    let grey = picture(F::Rgba8UnormSrgb, &[10, 10, 10, 40, 50, 50, 50, 80]);
    assert_eq!(all.map(|c| coverage(&grey, c)), [[10, 50], [10, 50], [10, 50], [40, 80]]);
    let two = picture(F::Rg8Unorm, &[10, 20, 50, 60]);
    assert_eq!([C::Red, C::Green].map(|c| coverage(&two, c)), [[10, 50], [20, 60]]);

    let missing = |image: &Image, channels| match read(image, channels) {
        Err(error @ WeatherMapError::MissingChannel { .. }) => error.to_string(),
        other => panic!("{channels:?}: {other:?}"),
    };
    let one = picture(F::R8Unorm, &[0, 255]);
    assert_eq!(coverage(&one, C::Red), [0, 255]);
    assert_eq!(missing(&one, C::Green), "the weather map has no green channel: its format is R8Unorm");
    for (image, channels) in [(&one, C::Blue), (&one, C::Alpha), (&two, C::Blue), (&two, C::Alpha)] {
        missing(image, channels);
    }
    // As pictures without alpha are loaded.
    let opaque = picture(F::Rgba8UnormSrgb, &[10, 20, 30, 255, 50, 60, 70, 255]);
    assert!(missing(&opaque, C::Alpha).starts_with("the weather map has no alpha channel: it is full everywhere"));
    // Only what is read must be a share.
    let bright = picture(F::Rg32Float, &floats(&[9.0, 0.0, 9.0, 1.0]));
    assert_eq!(coverage(&bright, C::Green), [0, 255]);
    let dark = picture(F::Rgba32Float, &floats(&[0.0, 0.0, 0.0, -3.0, 0.0, 0.0, 0.0, 1.0]));
    let error = read(&dark, C::Alpha).expect_err("no share").to_string();
    assert_eq!(error, "the weather map's coverage at texel (0, 0) is -3; it must be from 0 to 1");
}

#[test]
fn what_is_no_map_is_told() {
    use TextureFormat as F;
    let error = |image: &Image| WeatherMap::from_image(image).expect_err("no map").to_string();
    let good = picture(F::Rgba8Unorm, &[0, 0, 0, 0, 1, 2, 3, 4]);
    let mut gone = good.clone();
    gone.data = None;
    assert!(error(&gone).contains("no data on the CPU"));
    let mut short = good.clone();
    short.data = Some(vec![0; 7]);
    assert_eq!(error(&short), "the weather map has 7 bytes of data; its size and format need 8");
    let mut many = good.clone();
    many.texture_descriptor.size.depth_or_array_layers = 6;
    assert!(error(&many).contains("6 pictures"));
    let mut volume = good.clone();
    volume.texture_descriptor.dimension = TextureDimension::D3;
    assert!(error(&volume).contains("D3"));
    let mut wide = good.clone();
    wide.texture_descriptor.size.width = 9000;
    assert!(error(&wide).contains("9000 × 1 texels"));
    let mut packed = good.clone();
    packed.texture_descriptor.format = F::Bc7RgbaUnorm;
    assert_eq!(WeatherMap::from_image(&packed), Err(WeatherMapError::Format(F::Bc7RgbaUnorm)));
    let bright = picture(F::Rgba32Float, &floats(&[0.0, 0.0, 0.0, 9.0, 0.5, 255.0, 0.0, 0.0]));
    assert_eq!(error(&bright), "the weather map's height at texel (1, 0) is 255; it must be from 0 to 1");
    let nan = picture(F::R32Float, &floats(&[f32::NAN, 0.0]));
    assert!(error(&nan).contains("coverage at texel (0, 0) is NaN"));
}

#[test]
fn mips_after_the_first_are_left_alone() {
    let mut image = made(&small()).to_image();
    image.texture_descriptor.mip_level_count = 2;
    image.data.as_mut().unwrap().extend([9; 64 * 64 * 4]);
    assert!(WeatherMap::from_image(&image).unwrap() == made(&small()));
}

#[test]
fn samples_are_filtered_and_repeat() {
    let map = WeatherMap::from_image(&picture(TextureFormat::R8Unorm, &[0, 255])).unwrap();
    for (u, expected) in [(0.25, 0.0), (0.75, 1.0), (0.5, 0.5), (0.0, 0.5), (1.0, 0.5), (-0.25, 1.0), (7.25, 0.0)] {
        let found = map.sample(Vec2::new(u, 0.3)).x;
        assert!((found - expected).abs() < 1e-5, "{found} at {u}");
    }
    let map = made(&small());
    let far = map.sample(Vec2::new(40_000.25, -80_000.5));
    assert_eq!(far, map.sample(Vec2::new(0.25, 0.5)), "far places are as exact as near ones");
}

#[test]
fn resizing_keeps_the_mean() {
    let map = made(&small());
    let mean = |map: &WeatherMap| super::channel(map, 0).iter().sum::<f32>() / map.texels().len() as f32;
    for side in [32, 128, 256] {
        let resized = map.resized(UVec2::splat(side));
        assert_eq!(resized.size(), UVec2::splat(side));
        assert!((mean(&resized) - mean(&map)).abs() < 0.01, "{side}");
    }
    assert!(map.resized(map.size()).texels().iter().zip(map.texels()).all(|(a, b)| a[0].abs_diff(b[0]) <= 1));
}

/// Loads a file's bytes as Bevy's asset loader does.
fn loaded(bytes: &[u8], extension: &str) -> Image {
    let none = bevy::image::CompressedImageFormats::NONE;
    let kind = ImageType::Extension(extension);
    Image::from_buffer(bytes, kind, none, true, ImageSampler::Default, RenderAssetUsages::default())
        .unwrap_or_else(|error| panic!("{extension}: {error}"))
}

pub fn encoded(picture: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.into().write_to(&mut bytes, format).expect("encoded");
    bytes.into_inner()
}

/// A KTX2 file of one `R8G8B8A8_UNORM` picture of 1 × 2 texels, not compressed.
pub fn ktx2(texels: &[u8; 8]) -> Vec<u8> {
    let mut bytes = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    // Format, type size, width, height, depth, layers, faces, levels, supercompression; then where the empty description
    // lies, and that there are neither keys nor global data.
    for word in [37_u32, 1, 1, 2, 0, 0, 1, 1, 0, 104, 4, 0, 0] {
        bytes.extend(word.to_le_bytes());
    }
    for word in [0_u64, 0, 108, 8, 8] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(4_u32.to_le_bytes());
    bytes.extend(texels);
    bytes
}

/// EXR files are in `map_files`: Bevy loads them by another loader.
#[test]
fn files_become_maps() {
    let map = |image: &Image| WeatherMap::from_image(image).unwrap_or_else(|error| panic!("{error}")).texels().to_vec();
    let texels = [10, 20, 30, 255, 200, 100, 50, 255];
    let expected = vec![[10, 20, 30, 255], [200, 100, 50, 255]];
    let rgba = RgbaImage::from_raw(2, 1, texels.to_vec()).unwrap();
    assert_eq!(map(&loaded(&encoded(rgba, ImageFormat::Png), "png")), expected, "PNG of 8 bits");
    let long = texels.iter().map(|&b| u16::from(b) * 257).collect();
    let long = ImageBuffer::<Rgba<u16>, _>::from_raw(2, 1, long).unwrap();
    assert_eq!(map(&loaded(&encoded(long, ImageFormat::Png), "png")), expected, "PNG of 16 bits");
    let grey = GrayImage::from_raw(2, 1, vec![7, 200]).unwrap();
    let coverage = vec![[7, 255, 0, 255], [200, 255, 0, 255]];
    assert_eq!(map(&loaded(&encoded(grey, ImageFormat::Png), "png")), coverage, "grey PNG");
    assert_eq!(map(&loaded(&ktx2(&texels), "ktx2")), expected, "KTX2");
}
