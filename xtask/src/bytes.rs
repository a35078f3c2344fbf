//! The same bytes anywhere: what Lumbre writes on several instruction sets and platforms, as hashes in one table.

mod runs;
mod table;

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail};
use clap::Args;
use lumbre_simd::InstructionSet;
use xtask::command::root;

use runs::{FOLDER, Run, Runs};
use table::Table;

use crate::book;

/// The status of a program that does not have what is asked: EX_UNAVAILABLE of sysexits.h.
const UNAVAILABLE: i32 = 69;
/// The page that has the table.
const PAGE: &str = "docs/promises.md";

/// Pictures of all scenes, answers to rays, results and explanations, as hashes: by this machine's instruction sets,
/// and by other programs.
#[derive(Args)]
pub(crate) struct Bytes {
    /// Another program, and what runs it: "aarch64=qemu-aarch64 -L /usr/aarch64-linux-gnu lumbre". It is run at the
    /// root of the workspace, with relative names. Words are parted by blanks. Where it ends with status 69 it does not
    /// have what is asked, and its cell stays empty.
    #[arg(long, value_name = "NAME=COMMAND")]
    with: Vec<String>,
    /// Keep the table in docs/promises.md. Else what comes out is compared with the one that is there.
    #[arg(long)]
    update: bool,
}

/// A program, and how it is run.
struct Program {
    name: String,
    command: Vec<String>,
    /// Its limit, `LUMBRE_SIMD`.
    instruction_set: Option<&'static str>,
}

impl Bytes {
    pub(crate) fn run(self) -> Result<()> {
        let mut programs = native()?;
        for other in &self.with {
            programs.push(Program::named(other)?);
        }
        let table = Table::of(&programs)?;
        table.check_equal()?;
        if self.update { table.write(&root().join(PAGE)) } else { table.compare(&root().join(PAGE)) }
    }
}

/// What is kept is what this machine makes, and what others do.
pub(crate) fn test(others: &[String]) -> Result<()> {
    eprintln!("\n$ cargo xtask bytes");
    Bytes { with: others.to_vec(), update: false }.run()
}

/// The tested program (or that which `LUMBRE_PROGRAM` names) with every instruction set that this machine has, the best
/// first.
fn native() -> Result<Vec<Program>> {
    let program = book::program(true)?.to_string_lossy().into_owned();
    let sets = InstructionSet::available().into_iter().rev().map(InstructionSet::name);
    let program = |set| Program {
        name: format!("{} {set}", std::env::consts::ARCH),
        command: vec![program.clone()],
        instruction_set: Some(set),
    };
    Ok(sets.map(program).collect())
}

impl Program {
    fn named(text: &str) -> Result<Self> {
        let (name, command) = text.split_once('=').context("--with takes NAME=COMMAND")?;
        let command: Vec<String> = command.split_whitespace().map(str::to_owned).collect();
        if name.is_empty() || command.is_empty() || name.contains('|') {
            bail!("--with takes NAME=COMMAND (found \"{text}\")");
        }
        Ok(Self { name: name.to_owned(), command, instruction_set: None })
    }

    /// What it writes: to standard output, and to the files that the arguments name in [`FOLDER`]. None where it does
    /// not have what is asked.
    fn written(&self, run: &Run) -> Result<Option<Vec<u8>>> {
        let files: Vec<_> = run.outputs.iter().map(|name| root().join(FOLDER).join(name)).collect();
        for file in &files {
            if file.exists() {
                std::fs::remove_file(file)?;
            }
        }
        let mut command = Command::new(&self.command[0]);
        command.args(&self.command[1..]).args(&run.arguments).current_dir(root());
        if let Some(set) = self.instruction_set {
            command.env("LUMBRE_SIMD", set);
        }
        let out = command.output().with_context(|| format!("cannot start {}", self.name))?;
        if out.status.code() == Some(UNAVAILABLE) {
            return Ok(None);
        }
        let mut written = out.stdout;
        if !out.status.success() {
            if run.may_be_refused {
                written.extend(out.stderr);
                return Ok(Some(written));
            }
            let said = String::from_utf8_lossy(&out.stderr);
            bail!("{}: lumbre {}: {}", self.name, run.arguments.join(" "), said.trim_end());
        }
        for file in &files {
            written.extend(read(file, &self.name)?);
        }
        if written.is_empty() {
            bail!("{}: lumbre {}: nothing was written", self.name, run.arguments.join(" "));
        }
        Ok(Some(written))
    }

    /// The hash of what it writes in these runs.
    fn hash<'a>(&self, runs: impl IntoIterator<Item = &'a Run>) -> Result<Option<blake3::Hash>> {
        let mut hasher = blake3::Hasher::new();
        for run in runs {
            let Some(written) = self.written(run)? else { return Ok(None) };
            hasher.update(&written);
        }
        Ok(Some(hasher.finalize()))
    }
}

fn read(file: &Path, program: &str) -> Result<Vec<u8>> {
    std::fs::read(file).with_context(|| format!("{program}: {}", file.display()))
}

impl Table {
    /// Runs all programs. They work one after another, and go on with what others began.
    fn of(programs: &[Program]) -> Result<Self> {
        std::fs::create_dir_all(root().join(FOLDER))?;
        let runs = Runs::new()?;
        let mut table = Self::new(programs.iter().map(|program| program.name.clone()).collect());
        for program in programs {
            eprintln!("{}", program.name);
            for (row, runs) in &runs.alone {
                table.put(row, program.hash(runs)?);
            }
        }
        let has_parts = |program: &Program| Ok(program.written(&runs.begun)?.is_some());
        let sharing = programs.iter().map(has_parts).collect::<Result<Vec<bool>>>()?;
        let able: Vec<&Program> =
            programs.iter().zip(&sharing).filter_map(|(p, &able)| able.then_some(p)).collect();
        let mut resumed = Vec::new();
        for (i, program) in able.iter().enumerate() {
            able[(i + 1) % able.len()].written(&runs.begun)?;
            resumed.push(program.hash([&runs.resumed])?);
        }
        for (i, part) in runs.parts.iter().enumerate() {
            able[i % able.len()].written(part)?;
        }
        let merged = able.iter().map(|program| program.hash([&runs.merged])).collect::<Result<Vec<_>>>()?;
        for (row, hashes) in [(runs::RESUMED, resumed), (runs::MERGED, merged)] {
            let mut hashes = hashes.into_iter();
            for &is_able in &sharing {
                table.put(row, if is_able { hashes.next().flatten() } else { None });
            }
        }
        Ok(table)
    }
}
