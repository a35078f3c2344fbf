//! What can be asked of rays and points, and the answers.

use std::io::Cursor;
use std::ops::ControlFlow;

use clap::ValueEnum;
use lumbre::{Ray, Scene};

use super::answers::{Block, Form, Table};
use super::bytes::Bytes;
use super::rays::{RayReader, Rows};
use crate::failure::Failure;

/// What is asked of each ray or point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Query {
    /// The first hit.
    Closest,
    /// Whether there is a hit.
    Any,
    /// Every hit, by t.
    All,
    /// How many hits there are.
    Count,
    /// Of a point: the nearest point of all surfaces.
    ClosestPoint,
    /// Of a point: the distance to the nearest point of all surfaces.
    Distance,
    /// Of a point: whether it is inside a closed shape.
    Inside,
    /// Of a point: its winding number: 1 inside a closed body.
    Winding,
}

impl Query {
    /// The names.
    pub fn names() -> Vec<String> {
        let named = |query: &Self| query.to_possible_value().map(|value| value.get_name().to_owned());
        Self::value_variants().iter().filter_map(named).collect()
    }

    /// The query of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::from_str(name, false).ok()
    }

    /// What there is a line of for each answer.
    pub(super) fn table(self) -> Table {
        match self {
            Self::Closest | Self::All => Table::Hits,
            Self::Any => Table::Numbers("hit"),
            Self::Count => Table::Numbers("count"),
            Self::ClosestPoint => Table::Nearest,
            Self::Distance => Table::Reals("distance"),
            Self::Inside => Table::Flags("inside"),
            Self::Winding => Table::Reals("winding"),
        }
    }

    /// What it is asked of.
    pub(super) fn rows(self) -> Rows {
        match self {
            Self::Closest | Self::Any | Self::All | Self::Count => Rows::Rays,
            Self::ClosestPoint | Self::Distance | Self::Inside | Self::Winding => Rows::Points,
        }
    }

    /// How many rays to work on at a time: enough for batches, and few where each may have many answers.
    pub(super) fn at_a_time(self) -> usize {
        match self {
            Self::Closest | Self::Any => 4096,
            Self::Count => 1024,
            Self::All | Self::ClosestPoint | Self::Distance | Self::Inside | Self::Winding => 256,
        }
    }
}

/// The answers to consecutive rays or points, from this number on.
///
/// # Errors
/// Where there is no answer for a point.
pub(super) fn answer(
    scene: &Scene,
    query: Query,
    form: Form,
    first: u64,
    rays: &[Ray],
) -> Result<Block, Failure> {
    let mut block = Block::new(form, query.table());
    match query {
        Query::Closest => {
            let hits = scene.closest_batch(rays);
            (first..).zip(&hits).for_each(|(ray, hit)| block.push_hit(ray, hit.as_ref()));
        }
        Query::Any => {
            let hits = scene.any_batch(rays);
            (first..).zip(hits).for_each(|(ray, hit)| block.push_number(ray, u64::from(hit)));
        }
        Query::All => (first..).zip(rays).for_each(|(i, ray)| {
            scene.all(ray, |hit| {
                block.push_hit(i, Some(&hit));
                ControlFlow::Continue(())
            });
        }),
        Query::Count => {
            (first..).zip(rays).for_each(|(i, ray)| block.push_number(i, scene.count(ray) as u64))
        }
        Query::ClosestPoint | Query::Distance => {
            for (i, point) in (first..).zip(rays) {
                let nearest = scene.closest_point(point.origin, f64::INFINITY)?;
                match query {
                    Query::Distance => {
                        block.push_real(i, nearest.map_or(f64::INFINITY, |nearest| nearest.distance));
                    }
                    _ => block.push_nearest(i, nearest.as_ref()),
                }
            }
        }
        Query::Inside => {
            (first..).zip(rays).for_each(|(i, point)| block.push_flag(i, scene.is_inside(point.origin)))
        }
        Query::Winding => {
            for (i, point) in (first..).zip(rays) {
                block.push_real(i, scene.winding_number(point.origin)?);
            }
        }
    }
    Ok(block)
}

/// Answers a list of rays or points, CSV or `.npy`, as CSV: what `lumbre cast` prints. `name` names the list in
/// messages.
///
/// # Errors
/// [`Failure::Input`] with the place of what is wrong in the list, and where there is no answer for a point;
/// [`Failure::Limit`] where the answers take more bytes than `limit`.
pub fn cast(scene: &Scene, query: Query, name: &str, list: Vec<u8>, limit: usize) -> Result<String, Failure> {
    let mut rays = RayReader::new(Bytes::from_reader(name, Cursor::new(list))?, query.rows())?;
    let decoder = rays.decoder();
    let mut answers = format!("{}\n", query.table().header()).into_bytes();
    while let Some(piece) = rays.next(query.at_a_time())? {
        let block = answer(scene, query, Form::Csv, piece.first_ray, &decoder.rays(&piece)?)?;
        answers.extend(block.parts.concat());
        if answers.len() > limit {
            return Err(Failure::Limit(format!("{name}: more than {limit} bytes of answers")));
        }
    }
    String::from_utf8(answers).map_err(|e| Failure::Input(e.to_string()))
}
