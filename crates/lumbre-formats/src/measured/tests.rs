//! A synthetic file whose BRDF is known: GGX facets of α 0.4, and a spectrum that rises from 0.2 at 360 nm to 0.8 at
//! 830 nm.

use std::f64::consts::{FRAC_PI_2, PI};

use lumbre_math::{DVec3, Vec3};
use lumbre_shading::measured::Measured;
use lumbre_shading::{ShadingFrame, SpectrumValue};

use super::*;
use crate::Limits;

const ALPHA: f64 = 0.4;

struct Tensor {
    name: &'static str,
    shape: Vec<u64>,
    values: Vec<f32>,
}

fn ramp(n: usize) -> impl Iterator<Item = f64> + Clone {
    (0..n).map(move |i| i as f64 / (n - 1) as f64)
}

/// The arrays; where `leans`, the brightness and the colour rise from half to one and a half along the square.
fn tensors(leans: bool) -> Vec<Tensor> {
    let (angles, width, height, side, layers) = (10, 48, 24, 8, 5);
    let theta = |u: f64| u * u * FRAC_PI_2;
    let facets = |theta: f64| {
        let c2 = theta.cos().powi(2);
        ALPHA * ALPHA / (PI * (c2 * (ALPHA * ALPHA - 1.0) + 1.0).max(1e-9).powi(2))
    };
    let twice = |row: Vec<f64>| -> Vec<f32> { row.iter().chain(&row).map(|&v| v as f32).collect() };
    let ndf = ramp(width).map(|u| facets(theta(u))).collect();
    let sigma = ramp(width).map(|u| {
        let t = theta(u).min(FRAC_PI_2 - 1e-6);
        t.cos() * (1.0 + (1.0 + (ALPHA * t.tan()).powi(2)).sqrt()) / 2.0
    });
    let theta_i: Vec<f64> = ramp(angles).map(|t| 1.5 * t.powf(1.2)).collect();
    let mut vndf = vec![];
    for &t in &theta_i {
        let o = DVec3::new(t.sin(), 0.0, t.cos());
        for v in ramp(height) {
            let phi = (2.0 * v - 1.0) * PI;
            for u in ramp(width) {
                let t = theta(u);
                let m = DVec3::new(t.sin() * phi.cos(), t.sin() * phi.sin(), t.cos());
                vndf.push((facets(t) * o.dot(m).max(0.0) * u * t.sin() + 1e-7) as f32);
            }
        }
    }
    let along = |x: f64| if leans { 0.5 + 0.5 * x } else { 1.0 };
    let square: Vec<f64> = (0..side).flat_map(|_| ramp(side).map(along)).collect();
    let nm: Vec<f64> = ramp(layers).map(|t| 360.0 + 470.0 * t).collect();
    let layer = |nm: f64| square.iter().map(move |v| ((0.2 + 0.6 * (nm - 360.0) / 470.0) * v) as f32);
    let spectra = (0..angles).flat_map(|_| nm.iter().flat_map(|&nm| layer(nm))).collect();
    let luminance = (0..angles).flat_map(|_| square.iter().map(|&v| v as f32)).collect();
    let single = |values: &[f64]| values.iter().map(|&v| v as f32).collect();
    let (a, w, h, s, l) = (angles as u64, width as u64, height as u64, side as u64, layers as u64);
    vec![
        Tensor { name: "theta_i", shape: vec![a], values: single(&theta_i) },
        Tensor { name: "phi_i", shape: vec![1], values: vec![0.0] },
        Tensor { name: "wavelengths", shape: vec![l], values: single(&nm) },
        Tensor { name: "ndf", shape: vec![2, w], values: twice(ndf) },
        Tensor { name: "sigma", shape: vec![2, w], values: twice(sigma.collect()) },
        Tensor { name: "vndf", shape: vec![1, a, h, w], values: vndf },
        Tensor { name: "luminance", shape: vec![1, a, s, s], values: luminance },
        Tensor { name: "spectra", shape: vec![1, a, l, s, s], values: spectra },
    ]
}

fn file(tensors: &[Tensor]) -> Vec<u8> {
    let head: usize = tensors.iter().map(|t| 13 + t.name.len() + 8 * t.shape.len()).sum::<usize>() + 18;
    let mut bytes = [&b"tensor_file\0"[..], &[1, 0], &(tensors.len() as u32).to_le_bytes()].concat();
    let mut data: Vec<u8> = vec![];
    for tensor in tensors {
        bytes.extend((tensor.name.len() as u16).to_le_bytes());
        bytes.extend(tensor.name.as_bytes());
        bytes.extend((tensor.shape.len() as u16).to_le_bytes());
        bytes.push(10);
        bytes.extend(((head + data.len()) as u64).to_le_bytes());
        tensor.shape.iter().for_each(|size| bytes.extend(size.to_le_bytes()));
        tensor.values.iter().for_each(|value| data.extend(value.to_le_bytes()));
    }
    assert_eq!(bytes.len(), head);
    bytes.extend(data);
    bytes
}

fn read_bytes(bytes: &[u8]) -> Result<MeasuredTables> {
    read(bytes, &"test.bsdf".into(), &Budget::new(Limits::default()))
}

#[test]
fn a_known_material_matches_another_reader() {
    // The angles of view and of light in degrees, f at 550 nm, and the density, of both files.
    let expected = [
        ([0.0, 0.0], [40.0, 180.0], [0.110_358, 0.080_172_8], [0.190_73, 0.184_748]),
        ([40.0, 20.0], [30.0, 200.0], [0.298_654, 0.154_045], [0.584_499, 0.401_978]),
        ([60.0, 0.0], [55.0, 170.0], [0.566_062, 0.307_21], [0.730_259, 0.528_429]),
        ([20.0, -100.0], [70.0, 60.0], [0.167_377, 0.139_969], [0.128_849, 0.143_667]),
    ];
    let direction = |[theta, phi]: [f64; 2]| {
        let ((sin, cos), (y, x)) = (theta.to_radians().sin_cos(), phi.to_radians().sin_cos());
        ShadingFrame { s: Vec3::X, t: Vec3::Y, n: Vec3::Z }
            .to_local(DVec3::new(sin * x, sin * y, cos).as_vec3())
    };
    let pairs = vec![(360.0, 0.2), (830.0, 0.8)];
    let colour = SpectrumValue::Sampled(pairs).reflectance_rgb();
    let at_550 = 0.2 + 0.6 * (550.0 - 360.0) / 470.0;
    for (i, leans) in [false, true].into_iter().enumerate() {
        let measured = Measured::new(Arc::new(read_bytes(&file(&tensors(leans))).unwrap()));
        for (view, light, values, densities) in expected {
            for side in [1.0, -1.0] {
                let turned = |angles| {
                    let local = direction(angles);
                    if side < 0.0 { -local } else { local }
                };
                let (wo, wi) = (turned(view), turned(light));
                let value = measured.eval(wo, wi) / wi.abs_cos_theta();
                let expected = colour * (values[i] / at_550) as f32;
                let difference = (value - expected).map(f32::abs).max_component();
                assert!(difference < 2e-5, "{leans} {view:?} {light:?}: {value:?} {expected:?}");
                let density = f64::from(measured.pdf(wo, wi));
                assert!((density / densities[i] - 1.0).abs() < 2e-5, "{leans} {view:?}: {density}");
            }
        }
    }
}

#[test]
fn files_of_three_channels_are_read_too() {
    let mut list = tensors(true);
    list.retain(|tensor| !matches!(tensor.name, "wavelengths" | "spectra"));
    let values = (0..10).flat_map(|_| [0.25_f32, 0.5, 0.75].into_iter().flat_map(|v| [v; 64])).collect();
    list.push(Tensor { name: "rgb", shape: vec![1, 10, 3, 8, 8], values });
    let measured = Measured::new(Arc::new(read_bytes(&file(&list)).unwrap()));
    let local = |v: Vec3| ShadingFrame { s: Vec3::X, t: Vec3::Y, n: Vec3::Z }.to_local(v.normalize());
    let value = measured.eval(local(Vec3::new(0.1, 0.2, 0.7)), local(Vec3::new(-0.3, 0.2, 0.6)));
    assert!(value.r > 0.01);
    assert!((value.g / value.r - 2.0).abs() < 1e-5 && (value.b / value.r - 3.0).abs() < 1e-5, "{value:?}");
}

/// The message for a file with one thing changed.
fn refused(change: impl FnOnce(&mut Vec<Tensor>)) -> String {
    let mut list = tensors(false);
    change(&mut list);
    read_bytes(&file(&list)).unwrap_err().to_diagnostic().to_string()
}

#[test]
fn what_is_wrong_is_named_with_its_field_and_its_byte() {
    let bytes = file(&tensors(false));
    for length in 0..bytes.len() {
        // The head byte by byte, the data now and then.
        if length < 400 || length % 997 == 0 {
            let message = read_bytes(&bytes[..length]).unwrap_err().to_diagnostic().to_string();
            assert!(message.starts_with("error: "), "{length}: {message}");
        }
    }
    let by_bytes = |change: fn(&mut Vec<u8>)| {
        let mut bytes = bytes.clone();
        change(&mut bytes);
        read_bytes(&bytes).unwrap_err().to_diagnostic().to_string()
    };
    let cases = [
        (by_bytes(|b| b[0] = b'T'), "not a measured material"),
        (by_bytes(|b| b.splice(0..7, *b"SCATFUN").for_each(drop)), "Fourier BSDF of pbrt-v3"),
        (by_bytes(|b| b[12] = 2), "another version (found 2.0"),
        (by_bytes(|b| b[14..18].fill(255)), "too many fields"),
        // The type of the first field, and its offset.
        (by_bytes(|b| b[29] = 1), "field \"theta_i\": not of floating-point numbers (found type 1"),
        (by_bytes(|b| b[30..38].fill(255)), "field \"theta_i\": reaches beyond the end of the file"),
        (refused(|list| drop(list.remove(0))), "the file has no field \"theta_i\""),
        (refused(|list| list[1].name = "theta_i"), "field \"theta_i\" is there twice"),
        (refused(|list| list[0].values[3] = 0.0), "field \"theta_i\": numbers do not ascend"),
        (refused(|list| list[3].values[5] = -1.0), "field \"ndf\": wrong number (found -1"),
        (refused(|list| list[7].values[5] = f32::NAN), "field \"spectra\": wrong number (found NaN"),
        (refused(|list| list[5].shape = vec![1, 10, 48, 24, 1]), "field \"vndf\": wrong sizes"),
        (refused(|list| list[6].shape = vec![1, 5, 16, 8]), "found 1 × 5 × 16 × 8; expected 1 × 10"),
        (refused(|list| list[4].shape = vec![1, 96]), "field \"sigma\": wrong sizes (found 1 × 96"),
        (refused(|list| list[0].shape = vec![u64::MAX / 2]), "field \"theta_i\": reaches beyond"),
    ];
    for (message, part) in cases {
        assert!(message.contains(part) && message.contains("byte "), "{message}\n  lacks {part}");
    }
    let round = refused(|list| {
        list[1] = Tensor { name: "phi_i", shape: vec![3], values: vec![0.0, 1.0, 2.0] };
    });
    assert!(round.contains("do not go all the way round (found 0 to 2"), "{round}");
}

#[test]
fn a_file_is_counted_before_it_is_taken() {
    let bytes = file(&tensors(false));
    let limits = Limits { memory: 40_000, ..Limits::default() };
    let error = read(&bytes, &"test.bsdf".into(), &Budget::new(limits)).unwrap_err();
    assert!(error.to_string().contains("--max-memory"), "{error}");
}
