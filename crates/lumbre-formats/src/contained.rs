//! Turns panics of third-party decoders on malicious input into errors.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

use crate::diagnostic::{Diagnostic, FormatError, Place, quoted};

thread_local! {
    /// Whether a panic on this thread will be turned into an error.
    static CONTAINED: Cell<bool> = const { Cell::new(false) };
}

/// The result of `decode`, or an error when it panics.
///
/// The first call installs a panic hook in front of the process's own: it silences these panics, and passes all
/// others on. `decode` should own its data, which must not be used after a panic.
pub(crate) fn contained<T>(
    what: &str,
    place: &Place,
    decode: impl FnOnce() -> Result<T, FormatError>,
) -> Result<T, FormatError> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let others = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !CONTAINED.get() {
                others(info);
            }
        }));
    });
    let before = CONTAINED.replace(true);
    let answer = panic::catch_unwind(AssertUnwindSafe(decode));
    CONTAINED.set(before);
    answer.unwrap_or_else(|payload| {
        let said = payload
            .downcast_ref::<&str>()
            .map(|s| (*s).to_owned())
            .or_else(|| payload.downcast_ref::<String>().cloned())
            .unwrap_or_else(|| "no reason given".to_owned());
        let wrong = Diagnostic::error(format!("damaged {what}: its decoder gave up")).at(place.clone());
        Err(wrong.found(quoted(&said)).into())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_an_error_with_its_place() {
        let place = Place::whole("evil.png");
        let error =
            contained::<u32>("PNG image", &place, || panic!("index {} out of bounds", 7)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "evil.png: damaged PNG image: its decoder gave up (found \"index 7 out of bounds\")"
        );
        assert_eq!(contained("PNG image", &place, || Ok(5)).unwrap(), 5);
        assert!(!CONTAINED.get());
    }
}
