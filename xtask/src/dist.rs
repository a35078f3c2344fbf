//! What is handed out: the program for each platform, wheels, a Debian package, one of npm and the book, with the
//! licences of what they are made of, a list of it, and sums.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use clap::builder::PossibleValuesParser;
use xtask::command::{self, root};

use crate::book::Book;
use crate::{files, web};

use notices::Dependencies;
use target::TARGETS;
pub(crate) use target::Target;
use tools::Tools;

mod debian;
mod notices;
mod target;
mod tools;

/// The version of everything that is made.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// What is made, and how.
#[derive(Args, Debug)]
pub(crate) struct Dist {
    /// Only these, such as program-linux-x86_64,deb; by default all.
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = PossibleValuesParser::new(names()))]
    only: Vec<String>,
    /// How programs and wheels are compiled: dist, or trial, which is quick to compile and slow to run.
    #[arg(long, default_value = "dist")]
    profile: String,
    /// Take what is not committed, too.
    #[arg(long)]
    allow_dirty: bool,
}

/// A file that is handed out.
#[derive(Clone, Copy, Debug)]
enum Artefact {
    /// An archive with the program.
    Program(&'static Target),
    /// The Python package.
    Wheel(&'static Target),
    /// The program as a package of Debian.
    Deb,
    /// The package for Node.js and pages.
    Npm,
    /// The book as static pages.
    Book,
}

impl Artefact {
    fn all() -> impl Iterator<Item = Self> {
        let wheels = TARGETS.iter().filter(|target| target.has_wheel);
        let programs = TARGETS.iter().map(Self::Program);
        programs.chain(wheels.map(Self::Wheel)).chain([Self::Deb, Self::Npm, Self::Book])
    }

    fn name(self) -> String {
        match self {
            Self::Program(target) => format!("program-{}", target.name),
            Self::Wheel(target) => format!("wheel-{}", target.name),
            Self::Deb => "deb".to_owned(),
            Self::Npm => "npm".to_owned(),
            Self::Book => "book".to_owned(),
        }
    }
}

fn names() -> Vec<&'static str> {
    Artefact::all().map(|artefact| &*artefact.name().leak()).collect()
}

/// What came of an artefact.
enum Outcome {
    Made(PathBuf),
    /// Why it was left out, and how what it lacks is to be had.
    Lacks(String),
}

impl Dist {
    /// Makes what can be made on this machine into `target/dist`, and names the rest with what it lacks.
    ///
    /// # Errors
    /// When the work tree has changes, when something that was asked for by name cannot be made, and as the tools that
    /// it runs.
    pub(crate) fn run(self) -> Result<()> {
        ensure!(
            self.allow_dirty || command::output("git", &["status", "--porcelain"])?.is_empty(),
            "there are changes that are not committed (expected a clean work tree, or --allow-dirty)"
        );
        let folder = root().join("target/dist");
        if self.only.is_empty() && folder.exists() {
            fs::remove_dir_all(&folder).with_context(|| format!("cannot remove {}", folder.display()))?;
        }
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let tools = match Tools::find()? {
            Ok(tools) => tools,
            Err(lacks) => bail!("{lacks}"),
        };
        let maker = Maker { profile: &self.profile, folder: &folder, tools: &tools, pages: pages()? };
        let mut lacking = Vec::new();
        for artefact in Artefact::all() {
            let name = artefact.name();
            if !self.only.is_empty() && !self.only.contains(&name) {
                continue;
            }
            match maker.make(artefact).with_context(|| format!("{name} cannot be made"))? {
                Outcome::Made(path) => eprintln!("\n{name}: {}", path.display()),
                Outcome::Lacks(why) => lacking.push(format!("{name} is left out: {why}")),
            }
        }
        let sbom = folder.join(format!("lumbre-{VERSION}.cdx.json"));
        fs::write(&sbom, Dependencies::of(&["lumbre-cli", "lumbre-python"])?.sbom())?;
        let sums = tools.sums(&folder)?;
        for line in sums.lines() {
            let (sum, name) = line.split_once("  ").unwrap_or((line, ""));
            println!("{:>10}  {}  {name}", fs::metadata(folder.join(name))?.len(), &sum[..16.min(sum.len())]);
        }
        for line in &lacking {
            eprintln!("{line}");
        }
        ensure!(self.only.is_empty() || lacking.is_empty(), "not all that was asked for could be made");
        Ok(())
    }
}

/// The manual pages and completions of the program, in folders of these names; by the program that `LUMBRE_PROGRAM`
/// names, if any.
fn pages() -> Result<PathBuf> {
    let program = match std::env::var_os("LUMBRE_PROGRAM") {
        Some(named) => PathBuf::from(named),
        None => command::tested_program()?,
    };
    let program = program.to_string_lossy();
    let pages = command::target().join("dist-pages");
    if pages.exists() {
        fs::remove_dir_all(&pages).with_context(|| format!("cannot remove {}", pages.display()))?;
    }
    let (man, completions) = (pages.join("man"), pages.join("completions"));
    fs::create_dir_all(&man)?;
    fs::create_dir_all(&completions)?;
    command::run(&program, &["man", "--into", &man.to_string_lossy()])?;
    for (shell, name) in
        [("bash", "lumbre.bash"), ("zsh", "_lumbre"), ("fish", "lumbre.fish"), ("powershell", "_lumbre.ps1")]
    {
        fs::write(completions.join(name), command::output(&program, &["completions", shell])?)?;
    }
    Ok(pages)
}

/// What all artefacts are made with.
struct Maker<'a> {
    profile: &'a str,
    folder: &'a Path,
    tools: &'a Tools,
    pages: PathBuf,
}

impl Maker<'_> {
    fn make(&self, artefact: Artefact) -> Result<Outcome> {
        match artefact {
            Artefact::Program(target) => self.program(target),
            Artefact::Wheel(target) => self.wheel(target),
            Artefact::Deb => self.deb(),
            Artefact::Npm => self.npm(),
            Artefact::Book => {
                Book::whole().run()?;
                let archive = self.folder.join(format!("lumbre-{VERSION}-book.zip"));
                let staged = self.staged("book")?;
                files::copy(&command::target().join("book/html"), &staged)?;
                self.tools.pack(&staged, &archive)?;
                Ok(Outcome::Made(archive))
            }
        }
    }

    /// An empty folder whose name is that of what is in an archive.
    fn staged(&self, name: &str) -> Result<PathBuf> {
        let folder = command::target().join("dist-staged").join(format!("lumbre-{VERSION}-{name}"));
        if folder.exists() {
            fs::remove_dir_all(&folder).with_context(|| format!("cannot remove {}", folder.display()))?;
        }
        fs::create_dir_all(&folder)?;
        Ok(folder)
    }

    fn program(&self, target: &Target) -> Result<Outcome> {
        let built = match target.program(self.tools, self.profile)? {
            Ok(built) => built,
            Err(lacks) => return Ok(Outcome::Lacks(lacks)),
        };
        let staged = self.staged(target.name)?;
        fs::copy(&built, staged.join(built.file_name().context("a program has a name")?))
            .with_context(|| format!("cannot copy {}", built.display()))?;
        for name in ["README.md", "CHANGELOG.md", "LICENSE-MIT", "LICENSE-APACHE"] {
            fs::copy(root().join(name), staged.join(name))?;
        }
        fs::write(
            staged.join("THIRD-PARTY.md"),
            Dependencies::of(&["lumbre-cli"])?.notices(&target.linked(self.tools)?)?,
        )?;
        files::copy(&self.pages, &staged)?;
        let ending = if target.is_windows() { "zip" } else { "tar.gz" };
        let archive = self.folder.join(format!("lumbre-{VERSION}-{}.{ending}", target.name));
        self.tools.pack(&staged, &archive)?;
        Ok(Outcome::Made(archive))
    }

    fn wheel(&self, target: &Target) -> Result<Outcome> {
        // Where pyproject.toml looks for them; git ignores them.
        let package = root().join("crates/lumbre-python");
        for name in ["LICENSE-MIT", "LICENSE-APACHE"] {
            fs::copy(root().join(name), package.join(name))?;
        }
        fs::write(
            package.join("THIRD-PARTY.md"),
            Dependencies::of(&["lumbre-python"])?.notices(&target.linked(self.tools)?)?,
        )?;
        let wheels = self.staged("wheels")?;
        if let Err(lacks) = target.wheel(self.tools, self.profile, &wheels)? {
            return Ok(Outcome::Lacks(lacks));
        }
        let made = files::with_ending(&wheels, "whl")?;
        let [wheel] = &made[..] else { bail!("there are {} wheels in {}", made.len(), wheels.display()) };
        let place = self.folder.join(wheel.file_name().context("a wheel has a name")?);
        fs::copy(wheel, &place)?;
        Ok(Outcome::Made(place))
    }

    fn npm(&self) -> Result<Outcome> {
        let package = match web::package()? {
            Ok(package) => package,
            Err(lacks) => return Ok(Outcome::Lacks(lacks)),
        };
        let notices = Dependencies::on(&[web::TARGET], &["lumbre-web"])?.notices(&[])?;
        fs::write(package.join("THIRD-PARTY.md"), notices)?;
        let place = package.to_string_lossy();
        command::run("npm", &["pack", &place, "--pack-destination", &self.folder.to_string_lossy()])?;
        Ok(Outcome::Made(self.folder.join(format!("lumbre-{VERSION}.tgz"))))
    }

    fn deb(&self) -> Result<Outcome> {
        if !command::succeeds("dpkg-deb", &["--version"]) {
            return Ok(Outcome::Lacks("it needs dpkg-deb (apt-get install dpkg)".to_owned()));
        }
        let target = TARGETS.iter().find(|target| target.name == debian::TARGET).context("no such target")?;
        let built = match target.program(self.tools, self.profile)? {
            Ok(built) => built,
            Err(lacks) => return Ok(Outcome::Lacks(lacks)),
        };
        let staged = self.staged("deb")?;
        let notices = Dependencies::of(&["lumbre-cli"])?.notices(&target.linked(self.tools)?)?;
        let package = debian::package(&staged, &built, &self.pages, &notices, self.folder)?;
        Ok(Outcome::Made(package))
    }
}
