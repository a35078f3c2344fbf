//! Scopes: attributes, transforms and objects.

use std::rc::Rc;

use super::super::params::Param;
use super::super::source::{AtSpot, Result, SourcePosition};
use super::super::state::{EntityKind, Scope, ScopeKind};
use super::Parser;
use crate::Diagnostic;
use crate::diagnostic::quoted;

/// The maximal number of different names in `Attribute` for one kind of entity.
const MAX_DEFAULTS: usize = 1024;

impl Parser<'_, '_> {
    pub(super) fn attribute_begin(&mut self, spot: SourcePosition) -> Result<()> {
        self.open(ScopeKind::Attribute, spot)
    }

    pub(super) fn attribute_end(&mut self, spot: SourcePosition) -> Result<()> {
        self.close(ScopeKind::Attribute, spot)
    }

    pub(super) fn transform_begin(&mut self, spot: SourcePosition) -> Result<()> {
        if !self.in_world {
            self.converter.upgraded(spot);
        }
        self.open(ScopeKind::Transform, spot)
    }

    pub(super) fn transform_end(&mut self, spot: SourcePosition) -> Result<()> {
        self.close(ScopeKind::Transform, spot)
    }

    pub(super) fn object_begin(&mut self, spot: SourcePosition) -> Result<()> {
        let (name, at) = self.string("ObjectBegin", "a name in quotes")?;
        self.converter.begin_object(&name, spot, at)?;
        self.open(ScopeKind::Object, spot)
    }

    pub(super) fn object_end(&mut self, spot: SourcePosition) -> Result<()> {
        self.close(ScopeKind::Object, spot)?;
        self.converter.end_object();
        Ok(())
    }

    pub(super) fn attribute(&mut self, spot: SourcePosition) -> Result<()> {
        let names = EntityKind::NAMES.map(|(name, _)| name);
        let (kind, at) = self.string("Attribute", "a kind in quotes")?;
        let params = self.params()?;
        let Some((_, kind)) = EntityKind::NAMES.iter().find(|(name, _)| *name == kind) else {
            let wrong = Diagnostic::error("unknown kind of Attribute").found(quoted(&kind));
            return Err(at.wrong(wrong.suggest(&kind, names).expected(names.join(", "))));
        };
        let defaults = Rc::make_mut(&mut self.state.defaults[*kind as usize]);
        for param in params {
            self.converter.keep(size_of::<Param>() + param.bytes(), "defaults of Attribute", param.spot)?;
            let param = Rc::new(param);
            match defaults.binary_search_by(|p| p.name.cmp(&param.name)) {
                Ok(same) => defaults[same] = param,
                Err(at) if defaults.len() < MAX_DEFAULTS => defaults.insert(at, param),
                Err(_) => {
                    let message = format!("more than {MAX_DEFAULTS} different names in Attribute");
                    return Err(spot.error(message));
                }
            }
        }
        Ok(())
    }

    fn open(&mut self, kind: ScopeKind, spot: SourcePosition) -> Result<()> {
        self.converter.budget.nesting(self.scopes.len() + 1, kind.begin()).at(spot)?;
        self.scopes.push(Scope { kind, spot, saved: self.state.clone() });
        Ok(())
    }

    fn close(&mut self, kind: ScopeKind, spot: SourcePosition) -> Result<()> {
        let base = self.frames.iter().rev().find_map(|f| f.import.as_ref()).map_or(0, |import| import.1);
        let Some(scope) = self.scopes.pop_if(|scope| scope.kind == kind) else {
            return Err(match self.scopes.last() {
                None => spot.error(format!("{} without {}", kind.end(), kind.begin())),
                Some(open) => {
                    let at = open.spot;
                    let message = format!("{} inside {}", kind.end(), open.kind.begin());
                    let found = format!("{} at {}", open.kind.begin(), self.converter.files.place(at));
                    let wrong = Diagnostic::error(message).found(found);
                    spot.wrong(wrong.expected(open.kind.end()))
                }
            });
        };
        if self.scopes.len() < base {
            return Err(
                spot.error(format!("{} in an imported file closes what its importer opened", kind.end()))
            );
        }
        // pbrt-v3's saves only the transform; pbrt-v4 treats it as AttributeBegin.
        if kind == ScopeKind::Transform && self.converter.is_upgraded() {
            self.state.ctm = scope.saved.ctm;
            self.state.active = scope.saved.active;
        } else {
            self.state = scope.saved;
        }
        Ok(())
    }
}
