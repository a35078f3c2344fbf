//! No lane code loses its instruction set.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use object::{Object, ObjectSymbol, SymbolKind};

/// A vector instruction that stands alone as a function was called from code without its instruction set: it can be
/// inlined everywhere else. Such a call is many times slower. The causes are closures, functions without
/// `#[inline(always)]`, and methods such as `map` on arrays.
#[test]
fn every_vector_instruction_is_inlined() {
    let program = std::fs::read(env!("CARGO_BIN_EXE_lumbre")).unwrap();
    let program = object::File::parse(&*program).unwrap();
    let functions = program.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text);
    let names: Vec<String> = functions.filter_map(|symbol| Some(symbol.name().ok()?.to_owned())).collect();
    assert!(names.iter().any(|name| name.contains("run_avx512")), "the program has symbols");
    let is_vector = |name: &&String| name.contains("core_arch") && name.contains("_mm");
    // In builds with debug assertions, loads and stores check their addresses, and are too long to be inlined.
    let is_access = |name: &&String| name.contains("_load") || name.contains("_store");
    let lost: Vec<_> = names.iter().filter(is_vector).filter(|name| !is_access(name)).collect();
    assert!(lost.is_empty(), "{lost:#?}");
}
