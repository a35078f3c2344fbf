//! The limit on what compressed and shared data expands to.

use super::file::File;
use super::json::{Read, Value};
use crate::diagnostic::FormatError;
use crate::{LimitError, LimitKind};

/// Compressed data may expand to this size at any ratio: a few bytes can represent millions of vertices.
const FREE_EXPANSION: u64 = 8 << 20;

/// Rejects what a few bytes make too much of; `what` names it.
pub(super) fn check_expansion(
    file: &File<'_>,
    value: Value<'_>,
    what: &str,
    packed: u64,
    unpacked: u64,
) -> Read<()> {
    let limit = file.budget.limits().expansion;
    if unpacked <= FREE_EXPANSION.max(packed.saturating_mul(limit)) {
        return Ok(());
    }
    let source = LimitError {
        what: what.to_owned(),
        kind: LimitKind::Expansion,
        needed: unpacked.div_ceil(packed.max(1)),
        limit,
    };
    Err(FormatError::Limit { place: Some(value.place()), source })
}
