#![no_main]
#[allow(dead_code, reason = "the others have targets of their own")]
#[path = "../../crates/lumbre-formats/tests/hostile/mod.rs"]
mod hostile;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| hostile::pov::run(bytes));
