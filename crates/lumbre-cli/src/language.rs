//! The languages of explanations.

use clap::ValueEnum;

/// The languages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Language {
    /// English.
    En,
    /// Spanish.
    Es,
}

impl Language {
    /// The names.
    pub const NAMES: [&'static str; 2] = ["en", "es"];

    /// The language of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::from_str(name, false).ok()
    }

    /// The one of both that is in this language.
    pub(crate) fn choose<T>(self, english: T, spanish: T) -> T {
        match self {
            Self::En => english,
            Self::Es => spanish,
        }
    }
}

/// A sentence with what it is about in place of `{0}`, `{1}`, …
pub(crate) fn filled(text: &str, parts: &[&str]) -> String {
    let mut filled = text.to_owned();
    for (i, part) in parts.iter().enumerate() {
        filled = filled.replace(&format!("{{{i}}}"), part);
    }
    filled
}

#[cfg(test)]
pub(crate) mod tests {
    use std::fmt::Debug;

    use super::filled;

    /// That two tables have no empty sentence, the same places to be filled in, and nothing in common but `shared`, in
    /// this order.
    pub(crate) fn assert_translated(english: &impl Debug, spanish: &impl Debug, shared: &[&str]) {
        let (english, spanish) = (format!("{english:#?}"), format!("{spanish:#?}"));
        let (english, spanish) = (sentences(&english), sentences(&spanish));
        assert_eq!(english.len(), spanish.len());
        assert!(english.len() > 100, "{}", english.len());
        let places = |text: &str| [0, 1, 2].map(|i| text.matches(&format!("{{{i}}}")).count());
        for (sentence, translated) in english.iter().zip(&spanish) {
            assert!(!translated.is_empty(), "{sentence}");
            assert_eq!(places(sentence), places(translated), "{sentence} and {translated}");
        }
        let same = english.iter().zip(&spanish).filter(|(sentence, translated)| sentence == translated);
        assert_eq!(same.map(|(sentence, _)| *sentence).collect::<Vec<_>>(), shared);
    }

    /// The texts of a table as `Debug` lists them, one a line between quotes.
    fn sentences(listed: &str) -> Vec<&str> {
        let quoted = |line: &'_ str| Some((line.find('"')? + 1, line.rfind('"')?));
        listed.lines().filter_map(|line| quoted(line).map(|(start, end)| &line[start..end])).collect()
    }

    #[test]
    fn parts_stand_where_their_numbers_stood() {
        assert_eq!(filled("{1} of {0}, {1}", &["a", "{0}"]), "{0} of a, {0}");
        assert_eq!(filled("{0} {2}", &["a"]), "a {2}");
    }
}
