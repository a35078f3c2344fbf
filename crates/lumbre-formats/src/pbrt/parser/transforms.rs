//! The directives that change the current transform.

use lumbre_math::{DAffine3, DMat3, DMat4, DVec3, SingularTransformError, Transform};

use super::super::source::{Fault, Result, SourcePosition};
use super::Parser;
use crate::Diagnostic;
use crate::diagnostic::{number, quoted};

impl Parser<'_, '_> {
    pub(super) fn identity(&mut self, _spot: SourcePosition) -> Result<()> {
        self.replace_transform(Transform::IDENTITY);
        Ok(())
    }

    pub(super) fn translate(&mut self, spot: SourcePosition) -> Result<()> {
        let [x, y, z] = self.numbers("Translate")?;
        self.concat(spot, Ok(Transform::translate(DVec3::new(x, y, z))), "Translate")
    }

    pub(super) fn scale(&mut self, spot: SourcePosition) -> Result<()> {
        let [x, y, z] = self.numbers("Scale")?;
        self.concat(spot, Transform::scale(DVec3::new(x, y, z)), "Scale")
    }

    pub(super) fn rotate(&mut self, spot: SourcePosition) -> Result<()> {
        let [degrees, x, y, z] = self.numbers("Rotate")?;
        self.concat(spot, Transform::rotate(DVec3::new(x, y, z), degrees), "Rotate")
    }

    pub(super) fn look_at(&mut self, spot: SourcePosition) -> Result<()> {
        let [ex, ey, ez, lx, ly, lz, ux, uy, uz] = self.numbers("LookAt")?;
        let (eye, target, up) = (DVec3::new(ex, ey, ez), DVec3::new(lx, ly, lz), DVec3::new(ux, uy, uz));
        if eye == target {
            return Err(spot.error("LookAt from a point to itself: eye and target are equal"));
        }
        // Scaled first, so that no square over- or underflows.
        let unit = |v: DVec3| (v / v.abs().max_element()).normalize();
        let forward = unit(target - eye);
        if up == DVec3::ZERO {
            return Err(spot.error("LookAt with a zero up vector"));
        }
        let right = unit(up).cross(forward);
        if !forward.is_finite() || !right.is_finite() || right.length() < 1e-12 {
            return Err(spot.error("LookAt with its up vector along the line of sight"));
        }
        let right = unit(right);
        let axes = DMat3::from_cols(right, forward.cross(right), forward);
        let turn = Transform::from_affine(DAffine3::from_mat3(axes));
        let camera_from_world = turn.map(|turn| (Transform::translate(eye) * turn).inverse());
        self.concat(spot, camera_from_world, "LookAt")
    }

    pub(super) fn set_transform(&mut self, spot: SourcePosition) -> Result<()> {
        let matrix = self.numbers::<16>("Transform")?;
        let new = Transform::from_matrix(DMat4::from_cols_array(&matrix));
        let new = new.map_err(|_| singular(spot, "Transform"))?;
        self.replace_transform(new);
        Ok(())
    }

    pub(super) fn concat_transform(&mut self, spot: SourcePosition) -> Result<()> {
        let matrix = self.numbers::<16>("ConcatTransform")?;
        self.concat(spot, Transform::from_matrix(DMat4::from_cols_array(&matrix)), "ConcatTransform")
    }

    pub(super) fn coordinate_system(&mut self, _spot: SourcePosition) -> Result<()> {
        let (name, at) = self.string("CoordinateSystem", "a name in quotes")?;
        if !self.coordinate_systems.contains_key(&name) {
            self.converter.kept_name(&name, at)?;
            self.converter.keep(size_of::<[Transform; 2]>(), "coordinate systems", at)?;
        }
        self.coordinate_systems.insert(name, self.state.ctm);
        Ok(())
    }

    pub(super) fn coord_sys_transform(&mut self, _spot: SourcePosition) -> Result<()> {
        let (name, at) = self.string("CoordSysTransform", "a name in quotes")?;
        match self.coordinate_systems.get(&name) {
            Some(ctm) => self.state.ctm = *ctm,
            None => {
                let wrong = Diagnostic::warning(format!("unknown coordinate system {}", quoted(&name)));
                let wrong = wrong.suggest(&name, self.coordinate_systems.keys().map(String::as_str));
                self.converter.warn(at, wrong);
            }
        }
        Ok(())
    }

    pub(super) fn active_transform(&mut self, _spot: SourcePosition) -> Result<()> {
        let expected = "StartTime, EndTime or All";
        let token = self.expect(expected)?;
        self.state.active = match self.top().lexer.raw(token) {
            b"StartTime" => [true, false],
            b"EndTime" => [false, true],
            b"All" => [true, true],
            _ => return self.unexpected(token, "wrong argument of ActiveTransform", expected),
        };
        Ok(())
    }

    pub(super) fn transform_times(&mut self, spot: SourcePosition) -> Result<()> {
        let [start, end] = self.numbers::<2>("TransformTimes")?;
        if start >= end {
            let wrong = Diagnostic::error("the motion ends before it starts").found(number(end));
            return Err(spot.wrong(wrong.expected(format!("more than {}", number(start)))));
        }
        self.converter.transform_times = [start, end];
        Ok(())
    }

    fn replace_transform(&mut self, new: Transform) {
        for (ctm, active) in self.state.ctm.iter_mut().zip(self.state.active) {
            if active {
                *ctm = new;
            }
        }
    }

    /// Multiplies the active transforms by `by`.
    fn concat(
        &mut self,
        spot: SourcePosition,
        by: std::result::Result<Transform, SingularTransformError>,
        directive: &str,
    ) -> Result<()> {
        let by = by.map_err(|_| singular(spot, directive))?;
        for (ctm, active) in self.state.ctm.iter_mut().zip(self.state.active) {
            if !active {
                continue;
            }
            let new = *ctm * by;
            // A chain of valid scales may leave the range of numbers.
            let regular = |t: &DAffine3| t.is_finite() && t.matrix3 != DMat3::ZERO;
            if !regular(new.affine()) || !regular(new.inverse_affine()) {
                return Err(singular(spot, directive));
            }
            *ctm = new;
        }
        Ok(())
    }
}

fn singular(spot: SourcePosition, directive: &str) -> Fault {
    spot.error(format!("{directive} makes a transform that cannot be inverted"))
}
