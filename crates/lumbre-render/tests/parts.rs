//! Renders that are interrupted, and that are shared out, come to the picture of one that is neither.

use std::cell::RefCell;
use std::time::Duration;

use crate::caustics::lit_by_a_large_lamp;
use crate::common::*;
use crate::determinism::still_life;
use lumbre_math::DVec3;
use lumbre_math::random::RandomStream;
use lumbre_render::integrators::integrator;
use lumbre_render::{
    CancelToken, CheckpointSink, NoProgress, PixelBounds, RenderError, RenderOptions, RenderState, Rendered,
    render_from,
};
use lumbre_scene::{IntegratorKind, SamplerKind, Scene};

/// A scene by paths, and one by paths and photons.
fn scenes() -> [Scene; 2] {
    let mut glass = lit_by_a_large_lamp();
    glass.integrator.kind = IntegratorKind::Caustics;
    [still_life(DVec3::ZERO), glass].map(|desc| Scene::build(desc).expect("a scene"))
}

fn all_options(scene: &Scene) -> [RenderOptions; 4] {
    let base = options(scene, 45, 35, 11);
    let mut with_features = base.clone();
    with_features.features = true;
    with_features.sampler.kind = SamplerKind::Independent;
    let mut with_guides = base.clone();
    with_guides.guides = true;
    let mut adaptive = base.clone();
    (adaptive.stop.spp, adaptive.stop.noise) = (40, Some(0.2));
    [base, with_features, with_guides, adaptive]
}

fn run(
    scene: &Scene,
    options: &RenderOptions,
    state: Option<RenderState>,
    sink: Option<&CheckpointSink<'_>>,
) -> Result<(Rendered, RenderState), RenderError> {
    let integrator = integrator(&options.integrator);
    render_from(scene, options, &*integrator, &NoProgress, &CancelToken::new(), state, sink)
}

fn assert_same(a: &Rendered, b: &Rendered, what: &str) {
    assert_eq!(a.image, b.image, "{what}");
    assert_eq!((&a.coverage, &a.features, &a.guides), (&b.coverage, &b.features, &b.guides), "{what}");
    assert_eq!((a.stats.rays, a.stats.spp), (b.stats.rays, b.stats.spp), "{what}");
    let noise = |rendered: &Rendered| rendered.stats.noise.expect("two samples");
    assert!((noise(a) - noise(b)).abs() < 1e-12 * noise(b), "{what}");
}

fn bytes_of(state: &RenderState) -> Vec<u8> {
    let mut bytes = Vec::new();
    state.clone().write_to(&mut bytes).expect("a vector takes all bytes");
    bytes
}

#[test]
fn a_render_goes_on_from_any_state_to_the_same_picture() {
    let [by_paths, by_photons] = scenes();
    let with_options = |scene| all_options(scene).map(|options| (scene, options));
    let some_of = all_options(&by_photons).into_iter().take(1).map(|options| (&by_photons, options));
    for (scene, options) in with_options(&by_paths).into_iter().chain(some_of) {
        let whole = run(scene, &options, None, None).unwrap();
        let states = RefCell::new(Vec::new());
        // Without a pause between two looks: a state of every wave, also from the first, coarse pass.
        let keep = |state: RenderState| states.borrow_mut().push(bytes_of(&state));
        let sink = CheckpointSink { every: Duration::ZERO, keep: &keep };
        let mut slow = options.clone();
        slow.threads = 1;
        (slow.width, slow.height, slow.stop.spp) = (12, 9, 200);
        let small = run(scene, &slow, None, None).unwrap();
        let kept = run(scene, &slow, None, Some(&sink)).unwrap();
        assert_same(&kept.0, &small.0, "with hand-overs");
        let states = states.into_inner();
        assert!(states.len() > 20, "{}", states.len());
        let state_of = |bytes: &Vec<u8>| RenderState::read_from(&mut &bytes[..], u64::MAX).unwrap();
        assert!(states.iter().map(state_of).any(|state| state.least_samples() == 0 && state.taken() > 0));
        for state in states.iter().step_by(7).map(state_of) {
            assert!(state.taken() < state.wanted());
            let resumed = run(scene, &slow, Some(state), None).unwrap();
            assert_same(&resumed.0, &small.0, "resumed");
            assert_eq!(bytes_of(&resumed.1), bytes_of(&small.1));
        }
        // More samples for a finished render.
        let mut fewer = options.clone();
        fewer.stop.spp /= 2;
        let first = run(scene, &fewer, None, None).unwrap();
        let both = run(scene, &options, Some(first.1), None).unwrap();
        assert_same(&both.0, &whole.0, "more samples");
    }
}

#[test]
fn parts_are_merged_to_the_picture_of_the_whole() {
    let [by_paths, by_photons] = scenes();
    let [base, with_features, ..] = all_options(&by_paths);
    let [photons, ..] = all_options(&by_photons);
    for (scene, options) in [(&by_paths, base), (&by_paths, with_features), (&by_photons, photons)] {
        let whole = run(scene, &options, None, None).unwrap();
        let part = |bounds: PixelBounds, first: u32, last: u32, threads: usize| {
            let mut part = options.clone();
            part.crop = Some(bounds);
            (part.first_sample, part.stop.spp, part.threads) = (first, last - first, threads);
            run(scene, &part, None, None).unwrap().1
        };
        let all = options.bounds().unwrap();
        let (left, right) = (PixelBounds { x1: 19, ..all }, PixelBounds { x0: 19, ..all });
        let mut parts = vec![
            part(left, 0, 1, 1),
            part(left, 1, 8, 2),
            part(left, 8, 11, 1),
            part(right, 0, 5, 2),
            part(right, 5, 7, 1),
            part(right, 7, 10, 1),
            part(right, 10, 11, 2),
        ];
        let mut random = RandomStream::new(8);
        while parts.len() > 1 {
            let other = parts.swap_remove(random.next_below(parts.len()));
            let into = random.next_below(parts.len());
            parts[into].merge(&other).unwrap();
        }
        let merged = parts[0].to_rendered(options.transparent);
        assert!(parts[0].is_finished() && parts[0].gaps(all).is_empty());
        assert_same(&merged, &whole.0, "merged");
    }
}

#[test]
fn the_state_of_another_render_is_refused() {
    let scene = Scene::build(still_life(DVec3::ZERO)).unwrap();
    let base = options(&scene, 20, 15, 2);
    let (_, state) = run(&scene, &base, None, None).unwrap();
    let mut others = [base.clone(), base.clone(), base.clone()];
    others[0].width = 21;
    others[1].first_sample = 1;
    others[2].features = true;
    for other in others {
        assert_eq!(run(&scene, &other, Some(state.clone()), None).unwrap_err(), RenderError::OtherState);
    }
}
