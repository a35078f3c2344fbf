//! The computation of a shape's crossings, in a language.

use lumbre::Ray;
use lumbre::geometry::{Candidate, Explanation, Operand, Step, Value as Found};
use lumbre::math::glam::DMat4;

use super::document::{Column, Item, Quantity, Section, Textbook, Value, numbers};
use super::formula::Scope;
use super::texts::Texts;
use crate::language::filled;

impl From<&Found> for Value {
    fn from(found: &Found) -> Self {
        match found {
            Found::Number(x) => Self::Number(*x),
            Found::Vector(v) => Self::Vector(*v),
            Found::Numbers(numbers) => Self::Numbers(numbers.clone()),
            Found::Intervals(intervals) => Self::Intervals(intervals.clone()),
        }
    }
}

/// Adds the steps of a search for a kind of shape, and the results of the crossings. The scope contains the ray;
/// `rename` maps the symbols of the ray to the names used here.
pub(super) fn tell(
    section: &mut Section,
    (kind, explanation): (&str, &Explanation),
    ray: &Ray,
    scope: &mut Scope,
    rename: &dyn Fn(&str) -> String,
    texts: &Texts,
) {
    let operands = explanation.operands.iter().enumerate();
    section.sections.extend(operands.map(|(i, operand)| tell_operand(i, operand, ray, texts)));
    // The textbook has its own symbols.
    let mut schoolbook = scope.clone();
    for step in &explanation.steps {
        section.sections.push(tell_step(step, (kind, explanation), scope, &mut schoolbook, rename, texts));
    }
    if !explanation.candidates.is_empty() {
        let mut crossings = Section::new("crossings", texts.fates);
        let names: Vec<&'static str> =
            explanation.operands.iter().map(|operand| (texts.kind_of)(operand.name)).collect();
        crossings.items.push(candidates(&explanation.candidates, &names, texts));
        section.sections.push(crossings);
    }
}

fn tell_step(
    step: &Step,
    (kind, explanation): (&str, &Explanation),
    scope: &mut Scope,
    schoolbook: &mut Scope,
    rename: &dyn Fn(&str) -> String,
    texts: &Texts,
) -> Section {
    let mut section = Section::new(format!("{:?}", step.topic), (texts.topic)(step.topic));
    for told in &step.quantities {
        let value = Value::from(&told.value);
        let (symbol, formula) = (rename(&told.symbol), rename(&told.formula));
        let theirs = told.schoolbook.as_ref().map(|(formula, value)| {
            let (formula, value) = (rename(formula), Value::from(value));
            if let Some((name, _)) = formula.split_once(" = ") {
                schoolbook.set(name.trim(), &value);
            }
            let right = formula.split_once(" = ").map_or(&*formula, |(_, right)| right);
            let (written, sign) = match numbers(schoolbook, right, &value) {
                Some(numbers) => {
                    let written = format!("{formula} {} {}", numbers.sign_before(), numbers.written);
                    (written, numbers.sign_after())
                }
                None => (formula.clone(), "="),
            };
            Textbook { formula: written, sign, value }
        });
        section.items.push(Item::Quantity(Quantity {
            symbol: symbol.clone(),
            label: (texts.symbol)(step.topic, &told.symbol, kind).to_owned(),
            numbers: numbers(scope, &formula, &value),
            formula,
            value: value.clone(),
            is_rounded: false,
            schoolbook: theirs,
        }));
        scope.set(&symbol, &value);
        schoolbook.set(&symbol, &value);
    }
    for remark in &step.remarks {
        let name = |operand: usize| explanation.operands.get(operand).map_or("", |operand| operand.name);
        section.remark((texts.remark)(remark, &|operand| (texts.kind_of)(name(operand))));
    }
    section
}

fn candidates(candidates: &[Candidate], operands: &[&'static str], texts: &Texts) -> Item {
    let name = |operand: usize| operands.get(operand).copied().unwrap_or_default();
    let column = |key, title: &str| Column { key, title: title.to_owned() };
    let columns = vec![
        column("t", "t"),
        column("part", texts.part),
        column("multiplicity", texts.multiplicity),
        column("fate", texts.fate),
    ];
    let rows = candidates.iter().map(|candidate| {
        let multiplicity = candidate.root.map(|root| root.multiplicity.to_string()).unwrap_or_default();
        vec![
            Value::from(candidate.t),
            Value::Text(candidate.part.to_string()),
            Value::Text(multiplicity),
            Value::Text((texts.fate_of)(&candidate.fate, &name)),
        ]
    });
    Item::Table { key: "crossings", columns, rows: rows.collect() }
}

fn tell_operand(index: usize, operand: &Operand, ray: &Ray, texts: &Texts) -> Section {
    let title = filled(texts.operand, &[&index.to_string(), (texts.kind_of)(operand.name)]);
    let mut section = Section::new(format!("operand {index}"), title);
    let m = &operand.world_from_object;
    let own = if m.is_identity() { *ray } else { ray.into_object(m) };
    let mut scope = Scope::default();
    if !m.is_identity() {
        section.fact("M", DMat4::from(*m.affine()));
        section.quantity(&mut scope, "O", texts.operand_origin, "", own.origin);
        section.quantity(&mut scope, "D", texts.operand_direction, "", own.direction);
    }
    scope.set_ray(["O", "D"], &own);
    match &operand.explanation {
        Some(explanation) => {
            let explanation = (operand.name, explanation);
            tell(&mut section, explanation, &own, &mut scope, &str::to_owned, texts);
        }
        None => section.text(texts.not_looked_at),
    }
    section
}
