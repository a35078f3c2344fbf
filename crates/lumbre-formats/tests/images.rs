//! Image files come back as they were written, and as others wrote them.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use crate::common::{Random, changed, files_below, shared};
use lumbre_formats::image::{
    ExrCompression, ExrPrecision, ImageFormat, PngDepth, WriteOptions, encode_image, encode_layers,
    open_image, read_image, read_layers, write_image,
};
use lumbre_formats::{Budget, Diagnostics, FormatError};
use lumbre_image::{
    Channels, ColourSpace, Encoding, Image, Layer, Layers, PixelData, Rgb, ToneMap, f32_to_half, half_to_f32,
    linear_to_srgb, srgb_to_linear,
};

fn name(text: &str) -> Arc<str> {
    text.into()
}

/// Light over several stops, with a pixel at each end.
fn picture(width: u32, height: u32) -> Image {
    let mut random = Random(7);
    let colours = (0..width * height)
        .map(|i| match i {
            0 => Rgb::BLACK,
            1 => Rgb::WHITE,
            _ => Rgb::new(random.unit(), random.unit() * 0.1, random.unit().powi(3)),
        })
        .collect();
    Image::from_pixels(width, height, colours).unwrap()
}

fn covered(width: u32, height: u32) -> Image {
    let image = picture(width, height);
    let alpha: Vec<f32> = (0..width * height).map(|i| (i % 6) as f32 / 5.0).collect();
    let colours = image.pixels().iter().zip(&alpha).map(|(&c, &a)| c * a).collect();
    Image::from_pixels(width, height, colours).unwrap().with_alpha(alpha).unwrap()
}

fn back(bytes: &[u8], file: &str) -> Image {
    let mut said = Diagnostics::new();
    let read = read_image(bytes, &name(file), &Budget::default(), &mut said).unwrap();
    assert_eq!(said.lines(), Vec::<String>::new());
    read.to_image(&Budget::default()).unwrap()
}

fn worst(a: &Image, b: &Image) -> f32 {
    assert_eq!((a.width(), a.height()), (b.width(), b.height()));
    a.pixels()
        .iter()
        .zip(b.pixels())
        .map(|(&a, &b)| (a - b).map(f32::abs).max_component())
        .fold(0.0, f32::max)
}

#[test]
fn png_comes_back_to_half_a_step_of_its_curve() {
    for (depth, steps) in [(PngDepth::Eight, 255.0), (PngDepth::Sixteen, 65535.0)] {
        let options = changed(WriteOptions::default(), |it| it.png_depth = depth);
        let image = picture(23, 11);
        let bytes = encode_image(&image, ImageFormat::Png, &options).unwrap();
        let read = back(&bytes, "a.png");
        for (a, b) in image.pixels().iter().zip(read.pixels()) {
            for c in 0..3 {
                let error = (linear_to_srgb(a[c]) - linear_to_srgb(b[c])).abs();
                assert!(error <= 0.5 / steps + 1e-6, "{depth:?} {a:?} {b:?}");
            }
        }
        assert!(bytes.windows(4).any(|w| w == b"sRGB"));
    }
}

#[test]
fn png_keeps_coverage_apart_from_colour() {
    let image = covered(9, 5);
    let options = changed(WriteOptions::default(), |it| it.png_depth = PngDepth::Sixteen);
    let bytes = encode_image(&image, ImageFormat::Png, &options).unwrap();
    let read = back(&bytes, "a.png");
    assert!(worst(&image, &read) < 1e-4);
    assert!(image.alpha().unwrap().iter().zip(read.alpha().unwrap()).all(|(a, b)| (a - b).abs() < 1e-5));
}

#[test]
fn exr_comes_back_exactly_in_every_packing() {
    for compression in [ExrCompression::None, ExrCompression::Rle, ExrCompression::Zip, ExrCompression::Piz] {
        for precision in [ExrPrecision::Half, ExrPrecision::Float] {
            let options = changed(WriteOptions::default(), |it| {
                it.exr_compression = compression;
                it.exr_precision = precision;
            });
            let image = covered(37, 35);
            let image = image.map(|c| c * 300.0);
            let read = back(&encode_image(&image, ImageFormat::Exr, &options).unwrap(), "a.exr");
            let expected = match precision {
                ExrPrecision::Float => image.clone(),
                ExrPrecision::Half => image.clone().map(|c| c.map(|v| half_to_f32(f32_to_half(v)))),
            };
            assert_eq!(read.pixels(), expected.pixels(), "{compression:?} {precision:?}");
            assert!(worst(&image, &read) > 0.0 || precision == ExrPrecision::Float);
        }
    }
}

#[test]
fn exr_keeps_layers_and_the_digits_that_they_need() {
    let mut layers = Layers::from_image(&picture(6, 4));
    layers.push_image("albedo", &Image::filled(6, 4, Rgb::new(0.25, 0.5, 0.75))).unwrap();
    let depths: Vec<f32> = (0..24).map(|i| 1e5 + i as f32 / 8.0).collect();
    layers.push(Layer { name: "Z".into(), samples: depths.clone(), full_precision: true }).unwrap();
    let bytes = encode_layers(&layers, &WriteOptions::default()).unwrap();
    let read = read_layers(&bytes, &name("a.exr"), &Budget::default(), &mut Diagnostics::new()).unwrap();
    assert_eq!(read.get("Z").unwrap().samples, depths);
    assert!(read.get("Z").unwrap().full_precision && !read.get("albedo.R").unwrap().full_precision);
    assert_eq!(read.image("albedo"), layers.image("albedo"));
    assert_eq!(read.iter().len(), 7);
}

#[test]
fn exr_parts_lie_where_they_belong() {
    let part = picture(8, 6);
    let options = changed(WriteOptions::default(), |it| {
        it.exr_window = Some((5, 2, 20, 10));
        it.exr_precision = ExrPrecision::Float;
    });
    let bytes = encode_image(&part, ImageFormat::Exr, &options).unwrap();
    let whole = back(&bytes, "a.exr");
    assert_eq!(whole, part.placed(5, 2, 20, 10));
}

#[test]
fn hdr_and_pfm_come_back_and_jpeg_nearly() {
    let bright = picture(33, 7).map(|c| c * 1000.0);
    let pfm = back(&encode_image(&bright, ImageFormat::Pfm, &WriteOptions::default()).unwrap(), "a.pfm");
    assert_eq!(pfm, bright);
    for width in [5, 33, 200] {
        let bright = picture(width, 7).map(|c| c * 1000.0);
        let hdr = back(&encode_image(&bright, ImageFormat::Hdr, &WriteOptions::default()).unwrap(), "a.hdr");
        for (a, b) in bright.pixels().iter().zip(hdr.pixels()) {
            assert!((*a - *b).map(f32::abs).max_component() <= a.max_component() * 0.004, "{a:?} {b:?}");
        }
    }
    let ramp = (0..64 * 40).map(|i| Rgb::new((i % 64) as f32 / 64.0, 0.3, (i / 64) as f32 / 40.0)).collect();
    let ramp = Image::from_pixels(64, 40, ramp).unwrap();
    let jpeg = back(&encode_image(&ramp, ImageFormat::Jpeg, &WriteOptions::default()).unwrap(), "a.jpg");
    let error = ramp.pixels().iter().zip(jpeg.pixels()).map(|(a, b)| (*a - *b).map(f32::abs).max_component());
    assert!(error.sum::<f32>() / 2560.0 < 0.02);
}

#[test]
fn bytes_stay_bytes_and_scenes_may_say_what_they_mean() {
    let bytes = encode_image(&picture(7, 3), ImageFormat::Png, &WriteOptions::default()).unwrap();
    let budget = Budget::default();
    let file = read_image(&bytes, &name("t.png"), &budget, &mut Diagnostics::new()).unwrap();
    assert!(matches!(file.bitmap.data(), PixelData::U8(_)));
    assert_eq!(file.bitmap.encoding(), Encoding::Srgb);
    assert_eq!(file.bitmap.channels(), Channels::Rgb);
    assert_eq!(budget.memory_held(), 7 * 3 * 3);
    assert_eq!(file.colour_space, ColourSpace::REC709);
}

#[test]
fn display_formats_are_tone_mapped_and_others_are_not() {
    let image = Image::filled(4, 3, Rgb::new(2.0, 1.0, 0.5));
    let options = changed(WriteOptions::default(), |it| {
        it.tone_map = ToneMap::Neutral;
        it.exposure = 1.0;
    });
    let png = back(&encode_image(&image, ImageFormat::Png, &options).unwrap(), "a.png");
    let expected = ToneMap::Neutral.apply(Rgb::new(4.0, 2.0, 1.0));
    assert!((png.pixel(3, 2) - expected).map(f32::abs).max_component() < 0.01);
    let exr = back(&encode_image(&image, ImageFormat::Exr, &options).unwrap(), "a.exr");
    assert_eq!(exr, image);
}

#[test]
fn a_path_says_its_format_and_writing_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let image = picture(5, 4);
    for ending in ["png", "JPG", "exr", "hdr", "pfm"] {
        let path = folder.path().join(format!("a.{ending}"));
        write_image(&path, &image, &WriteOptions::default()).unwrap();
        let file = open_image(&path, &Budget::default(), &mut Diagnostics::new()).unwrap();
        assert_eq!(file.bitmap.width(), 5, "{ending}");
    }
    let wrong = write_image(&folder.path().join("a.gif"), &image, &WriteOptions::default()).unwrap_err();
    assert!(wrong.to_string().contains("unknown format to write (found \"gif\"; expected .png"), "{wrong}");
    let absent = write_image(&folder.path().join("no/a.png"), &image, &WriteOptions::default()).unwrap_err();
    assert!(matches!(absent, FormatError::Io { .. }));
}

#[test]
fn the_same_image_makes_the_same_bytes() {
    let image = covered(61, 47);
    for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Exr, ImageFormat::Hdr, ImageFormat::Pfm]
    {
        let options = WriteOptions::default();
        assert_eq!(
            encode_image(&image, format, &options).unwrap(),
            encode_image(&image, format, &options).unwrap()
        );
    }
}

#[test]
fn srgb_numbers_mean_the_light_of_the_standard() {
    // A PNG of one known byte, through the file: 188 is the light 0.5 to its nearest step.
    let image = Image::filled(3, 2, Rgb::splat(0.5));
    let bytes = encode_image(&image, ImageFormat::Png, &WriteOptions::default()).unwrap();
    let file = read_image(&bytes, &name("a.png"), &Budget::default(), &mut Diagnostics::new()).unwrap();
    assert_eq!(file.bitmap.data(), &PixelData::U8(vec![188; 18]));
    assert_eq!(file.bitmap.texel(2, 1, 1), srgb_to_linear(188.0 / 255.0));
}

#[test]
fn images_of_others_are_read() {
    let Some(folder) = shared("images") else { return };
    let mut files = files_below(&folder, &[".exr"]);
    if let Some(folder) = shared("hdri") {
        files.extend(files_below(&folder, &[".exr", ".hdr"]));
    }
    let mut read = 0;
    for path in &files {
        let budget = Budget::default();
        let mut said = Diagnostics::new();
        match open_image(path, &budget, &mut said) {
            Ok(file) => {
                let image = file.to_image(&budget).unwrap();
                let light = image.pixels().iter().filter(|c| !c.is_black()).count();
                let whole = file.bitmap.to_image();
                assert!(whole.pixels().iter().any(|c| !c.is_black()), "{} is black", path.display());
                // Of these the display window shows nothing, or one pixel of a corner.
                let part = path.file_stem().unwrap().to_str().unwrap();
                match part {
                    "t09" | "t10" | "t11" | "t12" => assert_eq!(light, 0, "{part}"),
                    "t13" => assert!(light == 1 && !image.pixel(0, 0).is_black()),
                    "t14" => {
                        assert!(light == 1 && !image.pixel(image.width() - 1, image.height() - 1).is_black())
                    }
                    _ => assert!(light > 1000, "{}", path.display()),
                }
                read += 1;
            }
            Err(e) => panic!("{e}"),
        }
    }
    assert!(read > 30, "{read} of {}", files.len());
}

#[test]
fn what_an_image_unpacks_to_is_bounded_before_it_is_unpacked() {
    // The header of a grey PNG of this size, and bytes after its end.
    let png = |side: u32, rest: usize| {
        let mut bytes = std::io::Cursor::new(vec![]);
        let pixel = image::GrayImage::from_raw(1, 1, vec![9]).unwrap();
        pixel.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        let mut bytes = bytes.into_inner();
        bytes[16..20].copy_from_slice(&side.to_be_bytes());
        bytes[20..24].copy_from_slice(&side.to_be_bytes());
        let mut check = flate2::Crc::new();
        check.update(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&check.sum().to_be_bytes());
        bytes.resize(bytes.len() + rest, 0);
        bytes
    };
    let read = |bytes: &[u8]| {
        let budget = Budget::default();
        let error = read_image(bytes, &"a.png".into(), &budget, &mut Diagnostics::new()).unwrap_err();
        (error.to_string(), budget.memory_peak())
    };
    // 256 MiB of some 40 kB.
    let (error, peak) = read(&png(16384, 40_000));
    assert!(error.contains("--max-expansion") && peak == 0, "{error} {peak}");
    // 16 MiB are unpacked at any ratio, here to find that their data end early.
    let (error, _) = read(&png(4096, 40_000));
    assert!(error.contains("damaged PNG image"), "{error}");
}

#[test]
fn exr_values_stay_finite_and_qoi_keeps_its_bytes() {
    let bright = Image::filled(3, 2, Rgb::new(70_000.0, 2.0, -0.5));
    let bytes = encode_image(&bright, ImageFormat::Exr, &WriteOptions::default()).unwrap();
    let read = |bytes: &[u8], name: &str| {
        let file = read_image(bytes, &name.into(), &Budget::default(), &mut Diagnostics::new()).unwrap();
        file.to_image(&Budget::default()).unwrap()
    };
    assert_eq!(read(&bytes, "a.exr").pixel(1, 1), Rgb::new(70_000.0, 2.0, -0.5));
    let shown = Image::filled(5, 3, Rgb::new(1.0, 0.0, srgb_to_linear(51.0 / 255.0)));
    let bytes = encode_image(&shown, ImageFormat::Qoi, &WriteOptions::default()).unwrap();
    assert!((read(&bytes, "a.qoi").pixel(4, 2) - shown.pixel(4, 2)).map(f32::abs).max_component() < 1e-6);
}

/// A scene whose texture, area light, environment and goniometric light are the image file `name`, written next to it.
fn scene_of_image(file: &str, bytes: &[u8]) -> (lumbre_scene::SceneDesc, Vec<String>) {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join(file), bytes).unwrap();
    let path = dir.path().join("a.pbrt");
    let text = format!(
        "WorldBegin\nLightSource \"infinite\" \"string filename\" \"{file}\"\n\
         LightSource \"goniometric\" \"string filename\" \"{file}\"\n\
         Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"{file}\"\n\
         Material \"diffuse\" \"texture reflectance\" \"t\"\nShape \"sphere\"\n\
         AreaLightSource \"diffuse\" \"string filename\" \"{file}\"\nShape \"sphere\"\n"
    );
    std::fs::write(&path, text).unwrap();
    let (scene, said) = lumbre_formats::open_scene(&path, &lumbre_formats::ReadOptions::default()).unwrap();
    (scene, said.lines())
}

#[test]
fn texels_that_are_not_finite_are_named_and_the_rest_shines() {
    let good = picture(10, 10).map(|c| c + Rgb::splat(0.5));
    for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut pixels = good.pixels().to_vec();
        pixels[37].g = wrong;
        let image = Image::from_pixels(10, 10, pixels).unwrap();
        let exr = changed(WriteOptions::default(), |it| it.exr_precision = ExrPrecision::Float);
        for (file, format) in [("bad.pfm", ImageFormat::Pfm), ("bad.exr", ImageFormat::Exr)] {
            let (scene, said) = scene_of_image(file, &encode_image(&image, format, &exr).unwrap());
            assert!(said.iter().all(|line| line.contains(file)), "{said:?}");
            assert!(
                said[0].contains("not finite, and taken for black (found texel (7, 3) of 10 by 10)"),
                "{said:?}"
            );
            for light in &scene.lights {
                let image = match light {
                    lumbre_scene::LightDesc::Infinite { image: Some(picture), .. } => &picture.image,
                    lumbre_scene::LightDesc::Goniometric { image, .. } => &image.image,
                    other => panic!("another light: {other:?}"),
                };
                assert!(image.pixels().iter().enumerate().all(|(i, c)| c.is_black() == (i == 37)));
            }
            assert_eq!(scene.lights.len(), 2);
            let light = scene.shapes[1].area_light.as_ref().unwrap().image.as_ref().unwrap();
            let at = |x: u32, y: u32| {
                let uv = lumbre_math::Vec2::new((x as f32 + 0.5) / 10.0, 1.0 - (y as f32 + 0.5) / 10.0);
                light.lookup(uv, lumbre_math::Vec2::ZERO, lumbre_math::Vec2::ZERO)
            };
            assert!(at(7, 3).max_component() < 1e-6 && at(2, 3).min_component() > 0.4, "{:?}", at(7, 3));
            assert!(lumbre_scene::Scene::build(scene).unwrap().warnings().is_empty());
        }
    }
}

#[test]
fn an_exr_texture_is_in_its_place_in_its_display_window() {
    // 6 by 5 pixels of 16 by 16, and beyond that window on one side.
    for (x, y) in [(3, 9), (13, -2)] {
        let part = Image::filled(6, 5, Rgb::new(0.75, 0.5, 0.25));
        let options = changed(WriteOptions::default(), |it| it.exr_window = Some((x, y, 16, 16)));
        let (scene, said) =
            scene_of_image("crop.exr", &encode_image(&part, ImageFormat::Exr, &options).unwrap());
        assert_eq!(said, [""; 0]);
        let image = scene.shapes[1].area_light.as_ref().unwrap().image.as_ref().unwrap();
        let mut lit = 0;
        for (row, column) in (0..16).flat_map(|row| (0..16).map(move |column| (row, column))) {
            let uv = lumbre_math::Vec2::new((column as f32 + 0.5) / 16.0, 1.0 - (row as f32 + 0.5) / 16.0);
            let found = image.lookup(uv, lumbre_math::Vec2::ZERO, lumbre_math::Vec2::ZERO);
            let is_in = (x..x + 6).contains(&column) && (y..y + 5).contains(&row);
            let expected = if is_in { Rgb::new(0.75, 0.5, 0.25) } else { Rgb::BLACK };
            assert!((found - expected).map(f32::abs).max_component() < 1e-3, "{row} {column}: {found:?}");
            lit += u32::from(is_in);
        }
        assert!(lit == 30 || lit == 9, "{lit}");
    }
}

#[test]
fn exposures_and_colour_corrections_of_hdr_are_taken_back() {
    let image = picture(9, 4);
    let plain = encode_image(&image, ImageFormat::Hdr, &WriteOptions::default()).unwrap();
    let plain_light = back(&plain, "a.hdr");
    let with = |lines: &str| {
        let end = plain.windows(2).position(|pair| pair == b"\n\n").unwrap() + 1;
        [&plain[..end], lines.as_bytes(), &plain[end..]].concat()
    };
    let check = |lines: &str, factor: [f32; 3]| {
        let found = back(&with(lines), "a.hdr");
        for (found, plain) in found.pixels().iter().zip(plain_light.pixels()) {
            let expected = *plain * Rgb::from(factor);
            assert!(
                (*found - expected).map(f32::abs).max_component() <= 1e-6 * expected.max_component(),
                "{lines}"
            );
        }
    };
    check("EXPOSURE=1.0\n", [1.0; 3]);
    check("EXPOSURE=4\n", [0.25; 3]);
    // Those of several steps are multiplied; a line that is indented belongs to a picture that this one was made of.
    check("EXPOSURE= 4.0\n\tEXPOSURE=100\nEXPOSURE=0.5\r\n", [0.5; 3]);
    check("COLORCORR= 2 0.5 1\nEXPOSURE=2\n", [0.25, 1.0, 0.5]);
    for wrong in [
        "EXPOSURE=0\n",
        "EXPOSURE=-1\n",
        "EXPOSURE=nan\n",
        "EXPOSURE=\n",
        "COLORCORR=1 2\n",
        "EXPOSURE=1e999\n",
    ] {
        let mut said = Diagnostics::new();
        let file = read_image(&with(wrong), &name("a.hdr"), &Budget::default(), &mut said).unwrap();
        assert_eq!(file.to_image(&Budget::default()).unwrap(), plain_light);
        assert!(
            said.lines().len() == 1 && said.lines()[0].contains("is not applied"),
            "{wrong}: {:?}",
            said.lines()
        );
    }
}
