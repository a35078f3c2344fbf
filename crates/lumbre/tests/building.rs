//! Scenes made in Rust: what the builder's words mean.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use lumbre::description::{Camera, FilmDesc, LightDesc};
use lumbre::geometry::{Aabb, Cylinder, ImplicitSurface, Sphere};
use lumbre::image::Rgb;
use lumbre::shading::Material;
use lumbre::{DVec3, Error, Ray, Scene, SceneBuilder, ShapeBuilder, Transform};

const CENTER: DVec3 = DVec3::new(2.0, -1.0, 3.5);

fn sky() -> LightDesc {
    LightDesc::Infinite {
        world_from_light: Transform::IDENTITY,
        radiance: Rgb::new(0.75, 0.5, 0.25),
        image: None,
    }
}

fn film(width: u32, height: u32) -> FilmDesc {
    FilmDesc { width: Some(width), height: Some(height), ..FilmDesc::default() }
}

/// A ball by its equation.
fn equation(radius: f64) -> ImplicitSurface {
    let bounds = Aabb { min: DVec3::splat(-radius), max: DVec3::splat(radius) }.outward(2);
    ImplicitSurface::new(bounds, move |[x, y, z]| x.square() + y.square() + z.square() - radius * radius)
        .unwrap()
}

#[test]
fn what_stands_to_the_right_is_to_the_right_in_the_picture() {
    // Looking along +y with z up, as the smallest example does: +x is to the right.
    let ball = |x: f64, colour: Rgb| {
        let ball = Sphere::new(DVec3::new(x, 0.0, 0.9), 0.9).unwrap();
        ShapeBuilder::exact(ball).shining(colour)
    };
    let eye = DVec3::new(0.0, -8.0, 3.0);
    let scene = SceneBuilder::new()
        .shape(ball(-1.2, Rgb::new(1.0, 0.0, 0.0)))
        .shape(ball(1.2, Rgb::new(0.0, 0.0, 1.0)))
        .camera(Camera::perspective(eye, DVec3::new(0.0, 0.0, 0.9), DVec3::Z, 32.0).unwrap())
        .film(film(64, 40))
        .build()
        .unwrap();
    let mut options = scene.options();
    options.stop = lumbre::Stop::at(4);
    let picture = scene.render(&options).unwrap();
    let (mut left, mut right) = (Rgb::BLACK, Rgb::BLACK);
    for (i, pixel) in picture.image().pixels().iter().enumerate() {
        let side = if i % 64 < 32 { &mut left } else { &mut right };
        *side += *pixel;
    }
    assert!(left.r > 20.0 * left.b.max(0.01) && right.b > 20.0 * right.r.max(0.01), "{left:?}, {right:?}");
}

#[test]
fn custom_geometry_renders_as_the_shape_it_describes() {
    let place = Transform::translate(CENTER) * Transform::scale(DVec3::new(1.5, 0.5, 1.0)).unwrap();
    let scene = |shape: ShapeBuilder| {
        SceneBuilder::new()
            .shape(shape.at(place).material(Material::diffuse(Rgb::splat(0.6))))
            .light(sky())
            .camera(Camera::perspective(CENTER - 6.0 * DVec3::Y, CENTER, DVec3::Z, 30.0).unwrap())
            .film(film(24, 16))
            .build()
            .unwrap()
    };
    let exact = scene(ShapeBuilder::exact(Sphere::new(DVec3::ZERO, 0.75).unwrap()));
    let custom = scene(ShapeBuilder::custom(equation(0.75)));
    let image = |scene: &Scene| {
        let mut options = scene.options();
        options.stop = lumbre::Stop::at(64);
        scene.render(&options).unwrap().image().clone()
    };
    let (expected, found) = (image(&exact), image(&custom));
    let mut seen = 0;
    for (found, expected) in found.pixels().iter().zip(expected.pixels()) {
        for (found, expected) in [(found.r, expected.r), (found.g, expected.g), (found.b, expected.b)] {
            assert!((found - expected).abs() < 0.02 * expected.max(0.1), "{found} for {expected}");
        }
        seen += usize::from(expected.r < 0.74);
    }
    assert!(seen > 50, "the ball covers {seen} pixels");
    // The same hits, and the framing of an automatic camera knows its box.
    let ray = Ray::new(CENTER - 6.0 * DVec3::Y, DVec3::Y);
    assert!((custom.closest(&ray).unwrap().t - 5.625).abs() < 1e-12);
    assert_eq!(custom.count(&ray), 2);
    let bounds = custom.info().bounds.unwrap();
    assert!((bounds.size() - DVec3::new(2.25, 0.75, 1.5)).length() < 1e-6, "{bounds:?}");
}

#[test]
fn instances_stand_in_all_of_their_places_and_none_elsewhere() {
    let places = [DVec3::ZERO, 3.0 * DVec3::X, 6.0 * DVec3::X];
    let balls = [equation(0.5)].map(ShapeBuilder::custom);
    let scene = SceneBuilder::new()
        .shape(ShapeBuilder::exact(Sphere::new(CENTER, 0.25).unwrap()))
        .instances(balls, places.map(Transform::translate))
        .build()
        .unwrap();
    for (i, place) in places.iter().enumerate() {
        let hit = scene.closest(&Ray::new(*place - 4.0 * DVec3::Z, DVec3::Z)).unwrap();
        assert!((hit.t - 3.5).abs() < 1e-12);
        assert_eq!((hit.instance, hit.shape), (Some(i as u32), 1));
        assert!(scene.is_inside(*place + 0.4 * DVec3::Y));
    }
    assert!(!scene.any(&Ray::new(DVec3::new(1.5, 0.0, -4.0), DVec3::Z)));
    assert_eq!(scene.closest(&Ray::new(CENTER - DVec3::Z, DVec3::Z)).unwrap().instance, None);
    assert!(SceneBuilder::new().instances([], [Transform::IDENTITY]).build().is_ok());
}

#[test]
fn point_queries_give_nearest_and_inside() {
    let scene = SceneBuilder::new()
        .shape(ShapeBuilder::exact(Sphere::new(CENTER, 2.0).unwrap()))
        .shape(ShapeBuilder::exact(Sphere::new(CENTER + 10.0 * DVec3::X, 3.0).unwrap()))
        .build()
        .unwrap();
    let nearest = scene.closest_point(CENTER + 5.5 * DVec3::X, f64::INFINITY).unwrap().unwrap();
    assert_eq!((nearest.distance, nearest.shape), (1.5, 1));
    assert_eq!(nearest.point, CENTER + 7.0 * DVec3::X);
    assert_eq!(scene.closest_point(CENTER + 5.5 * DVec3::X, 1.0).unwrap(), None);
    assert!(scene.is_inside(CENTER + DVec3::Z) && !scene.is_inside(CENTER + 4.0 * DVec3::X));
    assert_eq!(scene.winding_number(CENTER + 8.0 * DVec3::X).unwrap(), 1.0);
    assert_eq!(scene.winding_number(CENTER + 4.0 * DVec3::X).unwrap(), 0.0);

    // What has no answer says so.
    let tube = Cylinder::new(DVec3::ZERO, DVec3::Z, 1.0, false).unwrap();
    let open = SceneBuilder::new()
        .shape(ShapeBuilder::exact(tube))
        .shape(ShapeBuilder::custom(equation(0.25)).at(Transform::translate(CENTER)))
        .build()
        .unwrap();
    assert!(matches!(open.closest_point(CENTER, f64::INFINITY), Err(Error::ClosestPointError(_))));
    assert!(matches!(open.winding_number(CENTER), Err(Error::WindingNumberError(_))));
    assert!(open.closest_point(0.5 * DVec3::Z, f64::INFINITY).unwrap().is_some_and(|near| near.shape == 0));
}

#[test]
fn a_light_of_custom_geometry_shines_and_cannot_shine_by_power() {
    let builder = SceneBuilder::new()
        .shape(ShapeBuilder::custom(equation(0.5)).shining(Rgb::splat(2.0)))
        .camera(Camera::perspective(4.0 * DVec3::X, DVec3::ZERO, DVec3::Z, 5.0).unwrap())
        .film(film(4, 4));
    let mut by_power = builder.description().clone();
    by_power.shapes[0].area_light.as_mut().unwrap().power = Some(5.0);
    let wrong = Scene::from_description(by_power).unwrap_err();
    assert!(wrong.to_string().contains("shape 0: custom geometry cannot shine by power"), "{wrong}");

    let scene = builder.build().unwrap();
    let mean = scene.render(&scene.options()).unwrap().image().mean();
    assert!((mean.r - 2.0).abs() < 1e-5, "{mean:?}");
}

#[test]
fn a_replaced_camera_gives_the_same_picture() {
    let ball = || {
        SceneBuilder::new().shape(ShapeBuilder::exact(Sphere::new(CENTER, 0.75).unwrap())).film(film(9, 7))
    };
    let [here, there] = [4.0 * DVec3::X, DVec3::new(-3.0, 4.0, 1.0)]
        .map(|eye| Camera::perspective(CENTER + eye, CENTER, DVec3::Z, 40.0).unwrap());
    let mut scene = ball().light(sky()).camera(here).build().unwrap();
    let expected = ball().light(sky()).camera(there.clone()).build().unwrap();
    let picture = |scene: &Scene| scene.render(&scene.options()).unwrap().image().clone();
    assert_ne!(picture(&scene), picture(&expected));
    scene.replace_camera(0, there.clone()).unwrap();
    assert_eq!(picture(&scene), picture(&expected));
    let wrong = scene.replace_camera(1, there.clone()).unwrap_err();
    assert!(wrong.to_string().contains("there is no camera 1, but 1 of them"), "{wrong}");
    assert!(scene.replace_camera(0, there.with_lens(-1.0)).is_err());
    assert_eq!(picture(&scene), picture(&expected), "what is refused changes nothing");
}

#[test]
fn one_tree_has_pictures_from_elsewhere_and_in_other_light() {
    let ball = || {
        // One lamp is a shape: its light stays where lights other than shapes are others.
        let lamp = Sphere::new(CENTER + DVec3::new(3.0, -2.0, 4.0), 0.5).unwrap();
        SceneBuilder::new()
            .shape(ShapeBuilder::exact(Sphere::new(CENTER, 0.75).unwrap()))
            .shape(ShapeBuilder::exact(lamp).shining(Rgb::splat(20.0)))
            .film(film(9, 7))
    };
    let [here, there] = [4.0 * DVec3::X, DVec3::new(-3.0, 4.0, 1.0)]
        .map(|eye| Camera::perspective(CENTER + eye, CENTER, DVec3::Z, 40.0).unwrap());
    let lamp = LightDesc::Point { from: CENTER + 5.0 * DVec3::Z, intensity: Rgb::new(9.0, 8.0, 7.0) };
    let scene = ball().light(sky()).camera(here.clone()).build().unwrap();
    let other = ball().light(lamp).camera(there.clone());
    let desc = other.description().clone();
    let expected = other.build().unwrap();
    let picture = |scene: &Scene, view: Option<Camera>| {
        let mut options = scene.options().with_spp(4);
        options.view = view;
        scene.render(&options).map(|picture| picture.image().clone())
    };
    let relit = scene.relit(&desc).unwrap();
    assert!(
        relit.resolved().shares_tree(scene.resolved()) && !relit.resolved().shares_tree(expected.resolved())
    );
    assert_eq!(picture(&relit, None).unwrap(), picture(&expected, None).unwrap());
    assert_eq!(relit.info().lights, expected.info().lights);
    assert_ne!(picture(&scene, None).unwrap(), picture(&expected, None).unwrap());
    // A view is a camera of the options.
    assert_eq!(picture(&relit, Some(here.clone())).unwrap(), picture(&expected, Some(here)).unwrap());
    assert_eq!(
        picture(&scene.relit(&desc).unwrap(), Some(there.clone())).unwrap(),
        picture(&relit, None).unwrap()
    );
    let wrong = picture(&scene, Some(there.with_lens(-1.0))).unwrap_err();
    assert!(wrong.to_string().contains("lensradius"), "{wrong}");
    let none = lumbre::SceneDesc { cameras: vec![], ..desc };
    assert!(scene.relit(&none).is_err());
}

#[test]
fn a_picture_that_no_one_wants_is_not_put_together() {
    struct Gone;
    impl lumbre::Progress for Gone {
        fn is_wanted(&self) -> bool {
            false
        }
    }
    let ball = ShapeBuilder::exact(Sphere::new(CENTER, 0.75).unwrap());
    let scene = SceneBuilder::new().shape(ball).light(sky()).film(film(9, 7)).build().unwrap();
    let rendered = scene.render_with(&scene.options(), &Gone, &lumbre::CancelToken::new());
    assert!(matches!(rendered, Err(Error::Render(lumbre::RenderError::Unwanted))));
}

#[test]
fn the_variance_of_a_picture_falls_with_the_number_of_samples() {
    let ball = ShapeBuilder::exact(Sphere::new(CENTER, 0.75).unwrap());
    let scene = SceneBuilder::new().shape(ball).light(sky()).film(film(9, 7)).build().unwrap();
    let variance = |spp: u32| {
        let mut options = scene.options();
        options.stop = lumbre::Stop::at(spp);
        let cancel = lumbre::CancelToken::new();
        let (_, state) = scene.render_from(&options, &lumbre::NoProgress, &cancel, None, None).unwrap();
        let variance = state.variance();
        assert_eq!((variance.width(), variance.height()), (9, 7));
        variance.mean().r
    };
    assert_eq!(variance(1), 0.0);
    let (few, many) = (variance(8), variance(128));
    assert!(0.0 < many && many < 0.25 * few, "{few} {many}");
}
