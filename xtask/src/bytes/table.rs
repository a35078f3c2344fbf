//! Hashes by what was asked and by program.

use std::path::Path;

use anyhow::{Context, Result, bail};

const START: &str = "<!-- bytes -->\n";
const END: &str = "<!-- /bytes -->";
/// How many digits of a hash are kept.
const DIGITS: usize = 16;
const EQUAL: &str = "equal";

#[derive(Debug, PartialEq)]
pub(super) struct Table {
    programs: Vec<String>,
    /// Names, and a hash for each program in turn; none where the program does not have what is asked.
    rows: Vec<(String, Vec<Option<String>>)>,
}

/// What a page keeps: the hash of each row, and for which programs it is known to be theirs.
#[derive(Debug, PartialEq)]
struct Kept {
    programs: Vec<String>,
    rows: Vec<(String, String, Vec<bool>)>,
}

impl Table {
    pub(super) fn new(programs: Vec<String>) -> Self {
        Self { programs, rows: Vec::new() }
    }

    /// The hash of the next program, if it has one.
    pub(super) fn put(&mut self, row: &str, hash: Option<blake3::Hash>) {
        let hash = hash.map(|hash| hash.to_hex()[..DIGITS].to_owned());
        match self.rows.iter_mut().find(|(name, _)| name == row) {
            Some((_, hashes)) => hashes.push(hash),
            None => self.rows.push((row.to_owned(), vec![hash])),
        }
    }

    /// # Errors
    /// If programs differ; with the rows where they do.
    pub(super) fn check_equal(&self) -> Result<()> {
        let mut differences = Vec::new();
        for (name, hashes) in &self.rows {
            let first = first(name, hashes)?;
            for (program, hash) in self.programs.iter().zip(hashes) {
                if let Some(hash) = hash
                    && hash != first
                {
                    differences.push(format!("{name}: {program} {hash}, {} {first}", self.programs[0]));
                }
            }
        }
        // A render that was stopped, or shared out, is that of one run.
        let one = |name| self.rows.iter().find(|(row, _)| row == name).map(|(_, hashes)| &hashes[0]);
        for row in [super::runs::RESUMED, super::runs::MERGED] {
            if one(row) != one(super::runs::WHOLE) {
                differences.push(format!("{row}: not as in one run"));
            }
        }
        if differences.is_empty() {
            return Ok(());
        }
        bail!("not the same bytes:\n{}", differences.join("\n"))
    }

    /// # Errors
    /// If the page has other hashes, or other rows.
    pub(super) fn compare(&self, page: &Path) -> Result<()> {
        let kept = Kept::read(&std::fs::read_to_string(page)?)?;
        let hashes = |(name, hash, _): &(String, String, Vec<bool>)| (name.clone(), hash.clone());
        let kept: Vec<_> = kept.rows.iter().map(hashes).collect();
        let ours = self.rows.iter().map(|(name, hashes)| Ok((name.clone(), first(name, hashes)?.clone())));
        let ours: Vec<_> = ours.collect::<Result<_>>()?;
        let differing = |row: &&(String, String)| !kept.contains(row);
        let names: Vec<&str> = ours.iter().filter(differing).map(|(name, _)| name.as_str()).collect();
        if names.is_empty() && kept.len() == ours.len() {
            eprintln!("the same bytes in {} rows by {}", ours.len(), self.programs.join(", "));
            return Ok(());
        }
        bail!(
            "{} has other hashes ({}); where that is meant: cargo xtask bytes --update, and say why in the commit",
            page.display(),
            names.join("; ")
        )
    }

    /// Writes it into the page. What is kept of programs that did not run now stays where the hash is the same.
    pub(super) fn write(&self, page: &Path) -> Result<()> {
        let text = std::fs::read_to_string(page)?;
        let kept = Kept::read(&text)?;
        let (before, _, after) = parted(&text)?;
        std::fs::write(page, format!("{before}{START}{}{END}{after}", self.over(&kept)?.written()))?;
        eprintln!("{}", page.display());
        Ok(())
    }

    /// This, and what was known of other programs.
    fn over(&self, kept: &Kept) -> Result<Kept> {
        let others: Vec<usize> =
            (0..kept.programs.len()).filter(|&i| !self.programs.contains(&kept.programs[i])).collect();
        let rows = self.rows.iter().map(|(name, hashes)| {
            let hash = first(name, hashes)?;
            let before = kept.rows.iter().find(|(row, kept, _)| row == name && kept == hash);
            let known = others.iter().map(|&i| before.is_some_and(|(_, _, equal)| equal[i]));
            Ok((name.clone(), hash.clone(), hashes.iter().map(Option::is_some).chain(known).collect()))
        });
        let others = others.iter().map(|&i| kept.programs[i].clone());
        let rows = rows.collect::<Result<_>>()?;
        Ok(Kept { rows, programs: self.programs.iter().cloned().chain(others).collect() })
    }
}

/// The hash that the others of a row are compared with: that of this machine.
fn first<'a>(row: &str, hashes: &'a [Option<String>]) -> Result<&'a String> {
    hashes.first().and_then(Option::as_ref).with_context(|| format!("{row}: this machine has no hash"))
}

/// What stands before the table, its lines, and what follows.
fn parted(page: &str) -> Result<(&str, &str, &str)> {
    let (before, rest) = page.split_once(START).context("the page has no <!-- bytes -->")?;
    let (table, after) = rest.split_once(END).context("the page has no <!-- /bytes -->")?;
    Ok((before, table, after))
}

impl Kept {
    fn read(page: &str) -> Result<Self> {
        let (_, table, _) = parted(page)?;
        let cells = |line: &str| -> Vec<String> {
            line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect()
        };
        let mut lines = table.lines().filter(|line| !line.trim().is_empty());
        let programs = lines.next().map(cells).unwrap_or_default().into_iter().skip(2).collect();
        let mut rows = Vec::new();
        for line in lines.skip(1) {
            let cells = cells(line);
            let [name, hash, equal @ ..] = &cells[..] else { bail!("no row of hashes: {line}") };
            let equal = equal.iter().map(|cell| cell == EQUAL).collect();
            rows.push((name.clone(), hash.trim_matches('`').to_owned(), equal));
        }
        Ok(Self { programs, rows })
    }

    fn written(&self) -> String {
        let mut text = format!("\n| | BLAKE3 | {} |\n|---|---|", self.programs.join(" | "));
        text += &"---|".repeat(self.programs.len());
        text.push('\n');
        for (name, hash, equal) in &self.rows {
            let equal = equal.iter().map(|&is_equal| if is_equal { " equal |" } else { " |" });
            text += &format!("| {name} | `{hash}` |{}\n", equal.collect::<String>());
        }
        text.push('\n');
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bytes::runs::{MERGED, RESUMED, WHOLE};

    fn table(hashes: [&[u8]; 2]) -> Table {
        let mut table = Table::new(vec!["one".to_owned(), "two".to_owned()]);
        for hash in hashes {
            table.put("a row", Some(blake3::hash(hash)));
        }
        for row in [WHOLE, RESUMED, MERGED] {
            table.put(row, Some(blake3::hash(b"picture")));
            table.put(row, Some(blake3::hash(b"picture")));
        }
        table
    }

    #[test]
    fn programs_that_differ_are_named_with_the_row() {
        assert!(table([b"a", b"a"]).check_equal().is_ok());
        let error = table([b"a", b"b"]).check_equal().unwrap_err().to_string();
        assert!(error.contains("a row: two ") && error.contains("one "), "{error}");
    }

    #[test]
    fn a_render_that_was_shared_out_is_that_of_one_run() {
        let mut other = table([b"a", b"a"]);
        other.rows.last_mut().unwrap().1[0] = Some("0".to_owned());
        let error = other.check_equal().unwrap_err().to_string();
        assert!(error.contains(MERGED) && !error.contains(RESUMED), "{error}");
    }

    #[test]
    fn tables_read_back_and_keep_rows_of_other_programs() {
        let page = format!("text\n{START}{END}\nmore\n");
        let nothing = Kept::read(&page).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("page.md");
        std::fs::write(&file, page).unwrap();
        table([b"a", b"a"]).write(&file).unwrap();
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(text.starts_with("text\n") && text.ends_with("\nmore\n"), "{text}");
        assert_eq!(Kept::read(&text).unwrap(), table([b"a", b"a"]).over(&nothing).unwrap());
        table([b"a", b"a"]).compare(&file).unwrap();

        let mut alone = Table::new(vec!["three".to_owned()]);
        for (row, hash) in [("a row", &b"b"[..]), (WHOLE, b"picture")] {
            alone.put(row, Some(blake3::hash(hash)));
        }
        assert!(alone.compare(&file).unwrap_err().to_string().contains("(a row)"));
        alone.write(&file).unwrap();
        let kept = Kept::read(&std::fs::read_to_string(&file).unwrap()).unwrap();
        assert_eq!(kept.programs, ["three", "one", "two"]);
        assert_eq!(kept.rows[0].2, [true, false, false]);
        assert_eq!(kept.rows[1].2, [true, true, true]);
    }

    #[test]
    fn what_a_program_does_not_have_is_an_empty_cell() {
        let mut lacking = table([b"a", b"b"]);
        lacking.rows[0].1[1] = None;
        lacking.check_equal().unwrap();
        let kept = lacking.over(&Kept { programs: Vec::new(), rows: Vec::new() }).unwrap();
        assert_eq!(kept.rows[0].2, [true, false]);
        // This machine's own program has all rows.
        lacking.rows[0].1[0] = None;
        assert!(lacking.check_equal().unwrap_err().to_string().starts_with("a row: "));
    }
}
