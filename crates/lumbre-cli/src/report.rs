//! What a render says at its end.

use std::fs;
use std::time::Duration;

use lumbre::description::IntegratorKind;
use lumbre::{Picture, RenderOptions, Scene, Stats, Stop};
use serde_json::json;

use crate::threads;
use crate::units::{counted, spoken};

/// Warns of threads that the system refused, and of samples that were dropped.
pub(crate) fn warn_of_losses(threads_are_asked: bool, picture: &Picture) {
    let stats = picture.stats();
    let refused = if threads_are_asked { 0 } else { threads::refused() };
    let refused = refused.max(stats.refused_threads);
    if refused > 0 {
        say!("warning: the system grants {} of {} threads", stats.threads, stats.threads + refused);
    }
    for sample in &stats.first_dropped {
        say!("warning: pixel ({}, {}), sample {}: not finite, left out", sample.x, sample.y, sample.sample);
    }
    let unsaid = stats.dropped.saturating_sub(stats.first_dropped.len() as u64);
    if unsaid > 0 {
        say!("warning: {} more not finite and left out", counted(unsaid, "sample"));
    }
    if stats.clamped > 0 {
        let count = counted(stats.clamped, "sample");
        let most = Stats::MAX_SAMPLE;
        say!("warning: {count} brighter than {most:.1e}, the most that a sample counts for");
    }
}

/// What `--stats` writes.
pub(crate) fn statistics(
    scene: &Scene,
    picture: &Picture,
    seconds: serde_json::Value,
    warnings: Vec<String>,
) -> serde_json::Value {
    let stats = picture.stats();
    let accel = scene.resolved().accel();
    let primitives = accel.primitive_count();
    let build_seconds = scene.build_time().as_secs_f64();
    json!({
        "seconds": seconds,
        "threads": stats.threads,
        "width": picture.image().width(),
        "height": picture.image().height(),
        "spp": stats.spp,
        "most_spp": stats.most_spp,
        "rays": { "camera": stats.rays.camera, "bounce": stats.rays.bounce, "shadow": stats.rays.shadow },
        "paths_per_second": stats.paths_per_second(),
        "noise": stats.noise,
        "noise_target": stats.noise_target,
        "noise_target_met": stats.noise_target.map(|_| !stats.misses_noise_target()),
        "noisy_pixels": stats.noisy_pixels,
        "build": {
            "primitives": primitives,
            "primitives_per_second": primitives as f64 / build_seconds.max(1e-9),
            "bytes_per_primitive": accel.memory_bytes() as f64 / primitives.max(1) as f64,
        },
        "peak_memory_bytes": peak_memory(),
        "dropped_samples": stats.dropped,
        "clamped_samples": stats.clamped,
        "warnings": warnings,
    })
}

/// The peak memory of the process; `None` if the system does not report it.
fn peak_memory() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib * 1024)
}

/// What is to be said of a noise that was asked for and is not reached: by the whole picture, or by some of its pixels.
fn missed(stats: &Stats, stop: &Stop) -> Option<String> {
    let target = stats.noise_target?;
    // Where a signal ended it, everyone knows what goes on.
    let more = match stop.time {
        _ if stats.cancelled => "",
        Some(_) if stats.spp < stop.spp => " (give more --time)",
        _ => " (give more --spp)",
    };
    if stats.misses_noise_target() {
        return Some(format!("the target of {target} was not met{more}"));
    }
    let (noisy, are) = (stats.noisy_pixels, if stats.noisy_pixels == 1 { "is" } else { "are" });
    (noisy > 0).then(|| format!("{} {are} above {target}{more}", counted(noisy, "pixel")))
}

/// The share of light from lamps that the integrator of a scene, if it is `path`, hardly finds; `None` where that is
/// little.
pub(crate) fn caustics_not_found(scene: &Scene, options: &RenderOptions) -> Option<f64> {
    const MUCH: f64 = 0.003;
    let is_path = matches!(options.integrator.kind, IntegratorKind::Path { .. });
    let share = if is_path { scene.caustic_share(options).ok()? } else { 0.0 };
    (share > MUCH).then_some(share)
}

/// What is said of it.
pub(crate) fn caustics_line(share: f64) -> String {
    let percent = 100.0 * share;
    let digits = usize::from(percent < 10.0);
    format!(
        "{percent:.digits$} % of the light from lamps comes over mirrors or through glass: --integrator caustics finds it"
    )
}

/// The last line of a render; with `verbose`, the lines after it.
pub(crate) fn summary(
    verbose: bool,
    stop: &Stop,
    scene: &Scene,
    picture: &Picture,
    output: &str,
    render_time: Duration,
    denoised: Option<(&str, Duration)>,
) {
    let denoised =
        denoised.map_or_else(String::new, |(name, time)| format!(", denoised in {} ({name})", spoken(time)));
    let stats = picture.stats();
    let image = picture.image();
    let samples = if stats.spp > 0 {
        match stats.noise {
            Some(noise) if stop.noise.is_some() => {
                format!("{} to {} samples per pixel, noise {noise:.4}", stats.spp, stats.most_spp)
            }
            _ => format!("{} per pixel", counted(u64::from(stats.spp), "sample")),
        }
    } else {
        format!("a coarse picture of {}", counted(stats.samples, "sample"))
    };
    let missed = missed(stats, stop).map_or_else(String::new, |missed| format!("; {missed}"));
    say!(
        "{output}: {}x{}, {samples}, {}{denoised}{missed}",
        image.width(),
        image.height(),
        spoken(render_time)
    );
    if verbose {
        let rays = stats.rays;
        let total = rays.camera + rays.bounce + rays.shadow;
        say!(
            "{}, {:.2} M paths/s, {:.2} M rays/s ({} camera, {} bounce, {} shadow)",
            counted(stats.threads as u64, "thread"),
            stats.paths_per_second() / 1e6,
            total as f64 / render_time.as_secs_f64().max(1e-9) / 1e6,
            rays.camera,
            rays.bounce,
            rays.shadow
        );
        say!(
            "{}, tree built in {}",
            counted(scene.resolved().accel().primitive_count() as u64, "primitive"),
            spoken(scene.build_time())
        );
        if let Some(noise) = stats.noise {
            say!("noise {noise:.4}");
        }
    }
}
