//! The figure of a shape: the ray and the shape in the world and in the shape's own space, and F(t) along the ray. Its
//! marks have the names of the symbols of the explanation.

use std::collections::BTreeSet;

use lumbre::geometry::{Explanation, Fate, Shape, Topic, Value as Found};
use lumbre::{DVec3, Ray, Transform};

use super::along::{along, number, vector};
use super::formula::with_primes;
use super::misses::Nearest;
use super::numbers::label;
use super::plot::{Plot, plot};
use super::sketch::{Crossing, Name, Place, Radius, Space, lines, svg};
use super::texts::Texts;

/// Pictures that stand beside each other.
#[derive(Clone, Debug)]
pub(super) struct Figure {
    pub(super) panels: Vec<Panel>,
    pub(super) plot: Option<Plot>,
    /// The ray in the world, of which the slider shows a point.
    pub(super) ray: Ray,
    /// The crossings, by their names.
    pub(super) places: Vec<(Name, f64)>,
    /// The keys of all marks.
    pub(super) keys: BTreeSet<String>,
}

impl Figure {
    fn new(
        panels: Vec<Panel>,
        plot: Option<Plot>,
        ray: Ray,
        places: Vec<(Name, f64)>,
        marked: &Marked,
    ) -> Self {
        let keys = marked.iter().map(|(_, key)| key.clone());
        let there = places.iter().flat_map(|(name, _)| [name.key.clone(), normal_at(&name.key)]);
        let keys = keys.chain(there).collect();
        Self { panels, plot, ray, places, keys }
    }

    /// All pictures, as SVG.
    pub(super) fn pictures(&self) -> impl Iterator<Item = &str> {
        self.panels.iter().map(|panel| &*panel.svg).chain(self.plot.iter().map(|plot| &*plot.svg))
    }

    /// What the crossing at a `t` is marked by, with its point and its normal, which is called `normal`.
    pub(super) fn marked_at(&self, t: f64, normal: &str) -> Marked {
        let Some((name, _)) = self.places.iter().find(|(_, place)| *place == t) else { return Vec::new() };
        let there = ["t", "P"].map(|symbol| (symbol.to_owned(), name.key.clone()));
        there.into_iter().chain([(normal.to_owned(), normal_at(&name.key))]).collect()
    }
}

/// A picture with its title.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub(super) title: &'static str,
    pub(super) svg: String,
}

/// What symbols of an explanation are marked by: a symbol, and the key of its mark.
pub(super) type Marked = Vec<(String, String)>;

/// Where the ray meets the shape, with the normals in the world and in the shape's own space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    pub(super) t: f64,
    pub(super) normal: DVec3,
    pub(super) local_normal: DVec3,
}

/// What a figure is of.
#[derive(Debug)]
pub(super) struct Subject<'a> {
    pub(super) shape: &'a Shape,
    /// From the shape's own space to the world.
    pub(super) map: &'a Transform,
    /// Whether these are two spaces.
    pub(super) is_placed: bool,
    pub(super) explanation: &'a Explanation,
    pub(super) ray: &'a Ray,
    pub(super) object_ray: &'a Ray,
    pub(super) hits: &'a [Met],
    /// Where a ray that misses the shape comes nearest to it.
    pub(super) nearest: Option<Nearest>,
    /// What is up in the world.
    pub(super) up: DVec3,
    /// The vertices of the path that goes on from there.
    pub(super) path: &'a [DVec3],
}

/// The figure of what has no equation of its own, such as a curve: lines, the ray, and where they meet.
pub(super) fn of_hits(
    lines: Vec<Vec<Place>>,
    ray: &Ray,
    hits: &[Met],
    up: DVec3,
    path: &[DVec3],
    texts: &Texts,
) -> (Figure, Marked) {
    let named = hits.iter().enumerate().map(|(i, met)| {
        let name = Name { key: format!("crossing {i}"), label: Some(format!("t = {}", label(met.t))) };
        let label = (i == 0).then(|| "N".to_owned());
        let normal = Some((met.normal, Name { key: normal_at(&name.key), label }));
        Crossing { name, t: met.t, is_hit: true, normal }
    });
    let space = Space {
        lines,
        is_solid: false,
        ray: *ray,
        up,
        names: of_ray(""),
        crossings: named.collect(),
        points: Vec::new(),
        radii: Vec::new(),
        nearest: None,
        path: path.to_vec(),
    };
    let panel = Panel { title: texts.world_space, svg: svg(&space, texts.world_space) };
    let places = space.crossings.iter().map(|it| (it.name.clone(), it.t)).collect();
    let marked: Marked = ["O", "D"].map(|symbol| (symbol.to_owned(), symbol.to_owned())).to_vec();
    (Figure::new(vec![panel], None, *ray, places, &marked), marked)
}

/// What the origin of a ray and the ray are called.
fn of_ray(prime: &str) -> [Name; 2] {
    let line = format!("O{prime} + t·D{prime}");
    [Name::new(&format!("O{prime}")), Name { key: format!("D{prime}"), label: Some(line) }]
}

/// The points among the parameters of shapes.
const POINTS: [&str; 8] = ["C", "P₀", "P₁", "P₂", "P₀₀", "P₁₀", "P₀₁", "P₁₁"];
/// The roots of an equation, and the one of a plane.
const ROOTS: [&str; 5] = ["t₁", "t₂", "t₃", "t₄", "t"];

/// The key of the normal at a crossing.
pub(super) fn normal_at(key: &str) -> String {
    format!("N {key}")
}

impl Subject<'_> {
    /// The figure, and which symbols are marked in it.
    pub(super) fn figure(&self, texts: &Texts) -> (Figure, Marked) {
        let crossings = self.crossings();
        let nearest = self.nearest.map(|nearest| nearest.t);
        let mut panels =
            vec![Panel { title: texts.world_space, svg: svg(&self.world(&crossings), texts.world_space) }];
        if self.is_placed {
            let object = self.object(&crossings);
            panels.push(Panel { title: texts.object_space, svg: svg(&object, texts.object_space) });
        }
        let along = along(self.shape, self.explanation, self.object_ray);
        let plot = along.map(|along| {
            let title = if along.at(0.0).is_some() { texts.plot } else { texts.plot_of_intervals };
            let mut plot = plot(&along, &crossings, nearest, title);
            if self.is_placed {
                let of_ray = |text: &mut String| *text = with_primes(text, &["O", "D", "P"]);
                plot.formula.iter_mut().chain(&mut plot.definitions).for_each(of_ray);
            }
            plot
        });
        let places: Vec<(Name, f64)> = crossings.iter().map(|it| (it.name.clone(), it.t)).collect();
        let prime = if self.is_placed { "′" } else { "" };
        let mut marked: Marked = ["O", "D"].map(|symbol| (symbol.to_owned(), symbol.to_owned())).to_vec();
        if self.is_placed {
            marked.extend(["O′", "D′"].map(|symbol| (symbol.to_owned(), symbol.to_owned())));
        }
        let points = self.points().into_iter().map(|(symbol, _)| symbol);
        let radii = self.radii().into_iter().map(|radius| radius.name.key);
        let roots =
            places.iter().map(|(name, _)| name.key.clone()).filter(|key| ROOTS.contains(&key.as_str()));
        marked.extend(points.map(str::to_owned).chain(radii).chain(roots).map(|key| (key.clone(), key)));
        if let Some((first, _)) = places.iter().find(|(_, t)| self.hits.iter().any(|met| met.t == *t)) {
            marked.extend([(format!("N{prime}"), normal_at(&first.key))]);
        }
        (Figure::new(panels, plot, *self.ray, places, &marked), marked)
    }

    /// The crossings of the whole line, by the symbols of the roots that they are.
    fn crossings(&self) -> Vec<Crossing> {
        let steps = self.explanation.steps.iter().rev();
        let roots: Vec<(&str, f64)> = steps
            .flat_map(|step| &step.quantities)
            .filter_map(|quantity| match quantity.value {
                Found::Number(t) if ROOTS.contains(&&*quantity.symbol) => Some((&*quantity.symbol, t)),
                _ => None,
            })
            .collect();
        let factor = number(self.explanation, Topic::ScaledRay, "λ").unwrap_or(1.0);
        let mut found: Vec<Crossing> = Vec::new();
        for candidate in &self.explanation.candidates {
            let (t, is_hit) = (candidate.t, candidate.fate == Fate::Hit);
            // Parts that meet there share the place.
            if let Some(same) = found.iter_mut().find(|other| other.t == t) {
                same.is_hit |= is_hit;
                continue;
            }
            let is_new = |symbol: &str| found.iter().all(|other| other.name.key != symbol);
            let root = roots.iter().find(|(symbol, root)| *root / factor == t && is_new(symbol));
            let name = match root {
                Some((symbol, _)) => Name::new(symbol),
                None => Name {
                    key: format!("crossing {}", found.len()),
                    label: is_hit.then(|| format!("t = {}", label(t))),
                },
            };
            found.push(Crossing { name, t, is_hit, normal: None });
        }
        found
    }

    fn with_normals(
        &self,
        crossings: &[Crossing],
        symbol: &str,
        normal: impl Fn(&Met) -> DVec3,
    ) -> Vec<Crossing> {
        let mut is_first = true;
        let named = crossings.iter().map(|crossing| {
            let met = self.hits.iter().find(|met| met.t == crossing.t);
            let normal = met.map(|met| {
                let label = std::mem::take(&mut is_first).then(|| symbol.to_owned());
                (normal(met), Name { key: normal_at(&crossing.name.key), label })
            });
            Crossing { normal, ..crossing.clone() }
        });
        named.collect()
    }

    /// Where a ray comes to it, and how far that is.
    fn reach(&self, ray: &Ray, normal: impl Fn(&Met) -> DVec3) -> (Option<(DVec3, DVec3)>, f64) {
        let met = self.hits.first().map(|met| (ray.at(met.t), normal(met)));
        let nearest = self.nearest.map(|nearest| ray.at(nearest.t));
        let to = met.map(|(point, _)| point).or(nearest);
        let reach = to.map_or(f64::INFINITY, |to| (to - ray.origin).length());
        let closest = || {
            let nearest = self.nearest?;
            let point =
                self.shape.closest_point(&Transform::IDENTITY, self.object_ray.at(nearest.t)).ok()?.point;
            let away = ray.at(nearest.t) - point;
            Some((point, away.normalize_or(DVec3::Z)))
        };
        (met.or_else(closest), if reach > 0.0 { reach } else { 1.0 })
    }

    fn world(&self, crossings: &[Crossing]) -> Space {
        let (met, reach) = self.reach(self.ray, |met| met.normal);
        let mut points: Vec<(Name, DVec3)> = Vec::new();
        for (symbol, point) in self.points() {
            let label = if self.is_placed { format!("M {symbol}") } else { symbol.to_owned() };
            points.push((Name { key: symbol.to_owned(), label: Some(label) }, self.map.point(point)));
        }
        let nearest = self.nearest.map(|Nearest { t, in_object, .. }| {
            let point = match in_object {
                true => None,
                false => self.shape.closest_point(self.map, self.ray.at(t)).ok().map(|nearest| nearest.point),
            };
            (t, point)
        });
        Space {
            lines: lines(self.shape, self.map, met, reach),
            is_solid: self.shape.is_solid(),
            ray: *self.ray,
            up: self.up,
            names: of_ray(""),
            crossings: self.with_normals(crossings, "N", |met| met.normal),
            points,
            radii: if self.is_placed { Vec::new() } else { self.radii() },
            nearest,
            path: self.path.to_vec(),
        }
    }

    fn object(&self, crossings: &[Crossing]) -> Space {
        let (met, reach) = self.reach(self.object_ray, |met| met.local_normal);
        let nearest = self.nearest.map(|Nearest { t, in_object, .. }| {
            let point = match in_object {
                true => self
                    .shape
                    .closest_point(&Transform::IDENTITY, self.object_ray.at(t))
                    .ok()
                    .map(|it| it.point),
                false => None,
            };
            (t, point)
        });
        Space {
            lines: lines(self.shape, &Transform::IDENTITY, met, reach),
            is_solid: self.shape.is_solid(),
            ray: *self.object_ray,
            up: self.map.inverse_vector(self.up),
            names: of_ray("′"),
            crossings: self.with_normals(crossings, "N′", |met| met.local_normal),
            points: self.points().into_iter().map(|(symbol, point)| (Name::new(symbol), point)).collect(),
            radii: self.radii(),
            nearest,
            path: Vec::new(),
        }
    }

    /// The points that the shape is made of, by their symbols.
    fn points(&self) -> Vec<(&'static str, DVec3)> {
        let of = |symbol: &'static str| Some((symbol, vector(self.explanation, Topic::Parameters, symbol)?));
        POINTS.into_iter().filter_map(of).collect()
    }

    /// The radii that the shape is made of.
    fn radii(&self) -> Vec<Radius> {
        let number = |symbol: &str| number(self.explanation, Topic::Parameters, symbol);
        let vector = |symbol: &str| vector(self.explanation, Topic::Parameters, symbol);
        let radius = |symbol: &str, center: Option<DVec3>, axis: Option<DVec3>, from: f64| {
            let length = number(symbol).filter(|length| *length > 0.0)?;
            Some(Radius { name: Name::new(symbol), center: center?, axis, from, length })
        };
        let radii = match self.shape {
            Shape::Sphere(_) => vec![radius("r", vector("C"), None, 0.0)],
            Shape::Disk(_) => vec![radius("r", vector("C"), vector("n"), 0.0)],
            Shape::Torus(torus) => vec![
                radius("R", vector("C"), vector("V"), 0.0),
                radius("r", vector("C"), vector("V"), torus.major()),
            ],
            Shape::Cylinder(_) | Shape::Cone(_) | Shape::Capsule(_) => {
                let ends = [("r₁", vector("P₁")), ("r₂", vector("P₂"))];
                ends.map(|(symbol, center)| radius(symbol, center, vector("V"), 0.0)).to_vec()
            }
            Shape::Paraboloid(_) => {
                let top = number("H").map(|height| height * DVec3::Z);
                vec![radius("r", top, Some(DVec3::Z), 0.0)]
            }
            _ => Vec::new(),
        };
        radii.into_iter().flatten().collect()
    }
}
