//! What a product is made of: the packages that are compiled into it, with their licences for its users, and as a list
//! for machines.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use serde_json::{Value, json};
use xtask::command::{self, root};

use super::VERSION;
use super::target::TARGETS;

/// The packages of other people that are compiled into a product, on any of the platforms.
#[derive(Debug)]
pub(super) struct Dependencies {
    roots: Vec<String>,
    packages: Vec<Package>,
}

#[derive(Debug)]
struct Package {
    id: String,
    name: String,
    version: String,
    /// An SPDX expression.
    licence: String,
    folder: PathBuf,
    /// The SHA-256 sum of its file in the registry.
    sum: Option<String>,
    /// The ids of those that it is made with.
    needs: Vec<String>,
}

/// How files of licences are named.
const LICENCES: [&str; 6] = ["LICENSE", "LICENCE", "COPYING", "NOTICE", "COPYRIGHT", "UNLICENSE"];

impl Dependencies {
    /// Those of packages of the workspace on all platforms of programs and wheels, by cargo's own graph, without what
    /// only tests, builds and macros need.
    pub(super) fn of(roots: &[&str]) -> Result<Self> {
        Self::on(&TARGETS.iter().map(|target| target.triple).collect::<Vec<_>>(), roots)
    }

    /// The same on other platforms.
    pub(super) fn on(triples: &[&str], roots: &[&str]) -> Result<Self> {
        let mut arguments = vec!["metadata", "--format-version", "1", "--locked"];
        arguments.extend(triples.iter().flat_map(|triple| ["--filter-platform", triple]));
        let text = command::output("cargo", &arguments)?;
        let metadata: Value = serde_json::from_str(&text).context("cargo metadata is no JSON")?;
        let lock = fs::read_to_string(root().join("Cargo.lock")).context("cannot read Cargo.lock")?;
        let sums = sums_of(&lock);
        let mut packages: BTreeMap<String, Package> = BTreeMap::new();
        for package in array(&metadata["packages"]) {
            let (name, version) = (text_of(&package["name"]), text_of(&package["version"]));
            let manifest = PathBuf::from(text_of(&package["manifest_path"]));
            let sum = sums.get(&(name.clone(), version.clone())).cloned();
            let folder = manifest.parent().unwrap_or(Path::new("")).to_owned();
            // The old way to write OR.
            let licence = text_of(&package["license"]).replace('/', " OR ");
            let id = text_of(&package["id"]);
            let package = Package { id: id.clone(), name, version, licence, folder, sum, needs: Vec::new() };
            packages.insert(id, package);
        }
        let is_macro: BTreeSet<String> = array(&metadata["packages"])
            .filter(|package| {
                array(&package["targets"]).any(|t| array(&t["kind"]).any(|k| k == "proc-macro"))
            })
            .map(|package| text_of(&package["id"]))
            .collect();
        for node in array(&metadata["resolve"]["nodes"]) {
            let is_normal = |need: &&Value| array(&need["dep_kinds"]).any(|kind| kind["kind"].is_null());
            let needs = array(&node["deps"]).filter(is_normal).map(|need| text_of(&need["pkg"]));
            let needs = needs.filter(|need| !is_macro.contains(need)).collect();
            if let Some(package) = packages.get_mut(&text_of(&node["id"])) {
                package.needs = needs;
            }
        }
        let is_root = |package: &&Package| roots.contains(&&*package.name);
        let mut open: Vec<String> = packages.values().filter(is_root).map(|p| p.id.clone()).collect();
        ensure!(open.len() == roots.len(), "{roots:?} are not all packages of the workspace");
        let mut reached = BTreeSet::new();
        while let Some(id) = open.pop() {
            if reached.insert(id.clone()) {
                open.extend(packages.get(&id).into_iter().flat_map(|package| package.needs.clone()));
            }
        }
        packages.retain(|id, _| reached.contains(id));
        let mut packages: Vec<Package> = packages.into_values().collect();
        packages.sort_by(|a, b| (&a.name, &a.version).cmp(&(&b.name, &b.version)));
        Ok(Self { roots: roots.iter().map(|&name| name.to_owned()).collect(), packages })
    }

    /// The licences of all, with their texts, of which equal ones stand once; and of what else is linked, by name.
    ///
    /// # Errors
    /// When a package neither brings a text nor is under one of Lumbre's own licences.
    pub(super) fn notices(&self, linked: &[(&'static str, String)]) -> Result<String> {
        let mut out = String::from(
            "# What Lumbre is made of\n\nThe packages below are compiled into it, each under its licence. The standard library of Rust is \
             under MIT OR Apache-2.0.\n\n| package | licence |\n|---|---|\n",
        );
        let mut texts: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for (name, text) in linked {
            texts.entry(text.clone()).or_default().push((*name).to_owned());
        }
        for package in &self.packages {
            let title = format!("{} {}", package.name, package.version);
            let files = licence_files(&package.folder)?;
            // Those of Lumbre bring a text where they hold the work of others.
            if package.sum.is_none() && files.is_empty() {
                continue;
            }
            let may_be = |known: &str| package.licence.split(' ').any(|licence| licence == known);
            let remark = match files.is_empty() {
                false => "",
                true if may_be("MIT") || may_be("Apache-2.0") => ": LICENSE-MIT, LICENSE-APACHE",
                true if may_be("BSL-1.0") => ", which asks for no text in programs",
                true => bail!("{title}: there is no text of {}", package.licence),
            };
            let _ = writeln!(out, "| {title} | {}{remark} |", package.licence);
            for text in files {
                texts.entry(text).or_default().push(title.clone());
            }
        }
        for (text, titles) in texts {
            let _ = writeln!(
                out,
                "\n## {}\n\n```text\n{}\n```",
                titles.join(", "),
                text.trim().replace("```", "'''")
            );
        }
        Ok(out)
    }

    /// All of them as a software bill of materials in CycloneDX 1.5.
    pub(super) fn sbom(&self) -> String {
        let reference = |package: &Package| format!("pkg:cargo/{}@{}", package.name, package.version);
        let references: BTreeMap<&str, String> =
            self.packages.iter().map(|package| (&*package.id, reference(package))).collect();
        let component = |package: &Package| {
            let mut component = json!({
                "type": "library",
                "bom-ref": reference(package),
                "purl": reference(package),
                "name": package.name,
                "version": package.version,
                "licenses": [{ "expression": package.licence }],
            });
            if let Some(sum) = &package.sum {
                component["hashes"] = json!([{ "alg": "SHA-256", "content": sum }]);
            }
            component
        };
        let dependency = |package: &Package| {
            let needs = package.needs.iter().filter_map(|need| references.get(&**need));
            json!({ "ref": reference(package), "dependsOn": needs.collect::<BTreeSet<_>>() })
        };
        let whole = format!("pkg:generic/lumbre@{VERSION}");
        let roots = self.packages.iter().filter(|package| self.roots.contains(&package.name)).map(reference);
        let mut dependencies = vec![json!({ "ref": whole, "dependsOn": roots.collect::<Vec<_>>() })];
        dependencies.extend(self.packages.iter().map(dependency));
        let bom = json!({
            "bomFormat": "CycloneDX",
            "specVersion": "1.5",
            "version": 1,
            "metadata": { "component": {
                "type": "application", "bom-ref": whole, "name": "lumbre", "version": VERSION,
            } },
            "components": self.packages.iter().map(component).collect::<Vec<_>>(),
            "dependencies": dependencies,
        });
        format!("{bom:#}\n")
    }
}

/// The texts of the licences in a package's folder.
fn licence_files(folder: &Path) -> Result<Vec<String>> {
    let entries = fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_uppercase();
        path.is_file() && LICENCES.iter().any(|known| name.starts_with(known))
    });
    files.sort();
    let read = |path: &PathBuf| {
        let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        Ok(String::from_utf8_lossy(&bytes).replace("\r\n", "\n"))
    };
    files.iter().map(read).collect()
}

/// The sums in Cargo.lock, by name and version.
fn sums_of(lock: &str) -> BTreeMap<(String, String), String> {
    let value = |part: &str, key: &str| {
        let line = part.lines().find_map(|line| line.strip_prefix(key))?;
        Some(line.trim_start_matches(" = ").trim_matches('"').to_owned())
    };
    let parts = lock.split("[[package]]").skip(1);
    parts
        .filter_map(|part| Some(((value(part, "name")?, value(part, "version")?), value(part, "checksum")?)))
        .collect()
}

fn array(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

fn text_of(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_platform_has_its_own_dependencies() {
        let dependencies = Dependencies::on(&["wasm32-unknown-unknown"], &["lumbre-web"]).expect("the graph");
        let has = |name: &str| dependencies.packages.iter().any(|package| package.name == name);
        assert!(has("wasm-bindgen") && has("lumbre-kernel") && !has("winapi-util"), "{dependencies:?}");
    }

    #[test]
    fn every_dependency_has_a_licence_with_its_text() {
        let dependencies = Dependencies::of(&["lumbre-cli"]).expect("the graph");
        let has = |name: &str| dependencies.packages.iter().any(|package| package.name == name);
        assert!(has("clap") && has("lumbre-kernel") && has("winapi-util"), "{dependencies:?}");
        // Macros and tests are not in it.
        assert!(!has("clap_derive") && !has("proptest") && !has("pyo3"), "{dependencies:?}");
        assert!(dependencies.packages.iter().all(|package| !package.licence.is_empty()));
        let notices = dependencies.notices(&[]).expect("every text");
        assert!(notices.contains("| glam ") && notices.contains("Permission is hereby granted"));
        // The work of others that is in packages of Lumbre.
        let shading = format!("| lumbre-shading {VERSION} | (MIT OR Apache-2.0) AND BSD-3-Clause |");
        assert!(notices.contains(&shading), "{notices}");
        assert!(notices.contains("Copyright (c) 2012 - 2013, Lukas Hosek and Alexander Wilkie"));
        let formats = format!("| lumbre-formats {VERSION} | (MIT OR Apache-2.0) AND Apache-2.0 |");
        assert!(notices.contains(&formats) && notices.contains("PhysLight"), "{notices}");
        assert!(!notices.contains("| lumbre-kernel "));
        let bom: Value = serde_json::from_str(&dependencies.sbom()).expect("JSON");
        let refs: BTreeSet<&str> =
            array(&bom["components"]).filter_map(|component| component["bom-ref"].as_str()).collect();
        assert!(refs.len() > 50 && refs.len() == dependencies.packages.len());
        let of = |dependency: &Value| text_of(&dependency["ref"]);
        let cli = format!("pkg:cargo/lumbre-cli@{VERSION}");
        let needs = array(&bom["dependencies"]).find(|d| of(d) == cli).expect("the program");
        assert!(array(&needs["dependsOn"]).any(|need| need == &format!("pkg:cargo/lumbre@{VERSION}")));
        assert!(array(&needs["dependsOn"]).all(|need| refs.contains(need.as_str().expect("a name"))));
    }
}
