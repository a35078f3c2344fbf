//! A render shared out by a scheduler comes to the file of one machine.

#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::Command;

use crate::files::{Folder, answer};
use crate::parts::{bytes, done, folder, refused, signal, until_there};

/// A scheduler that runs at once what it is given: the tasks of an array from the last to the first, the first of them
/// twice.
const SBATCH: &str = r#"#!/bin/sh
set -eu
for script; do :; done
echo "$*" >> sbatch.log
range=$(sed -n 's/^#SBATCH --array=0-//p' "$script")
if [ -n "$range" ]; then
  task=$range
  while [ "$task" -ge 0 ]; do
    SLURM_ARRAY_TASK_ID=$task "$script" >&2
    task=$((task - 1))
  done
  SLURM_ARRAY_TASK_ID=0 "$script" >&2
else
  "$script" >&2
fi
echo "17;cluster"
"#;

fn with_sbatch(folder: &Folder, arguments: &str) -> (i32, String) {
    folder.write("bin/sbatch", SBATCH);
    fs::set_permissions(folder.path("bin/sbatch"), fs::Permissions::from_mode(0o755)).unwrap();
    let arguments: Vec<&str> = arguments.split_whitespace().collect();
    let mut command = folder.command(&arguments);
    let path = std::env::var("PATH").unwrap();
    command.env("PATH", format!("{}:{path}", folder.path("bin").display()));
    answer(command.output().unwrap())
}

#[test]
fn an_array_of_tasks_and_its_merge_make_the_file_of_one_run() {
    let folder = folder();
    fs::create_dir(folder.path("bin")).unwrap();
    done(&folder, "render scene.pbrt -o whole.exr --max-depth 3");
    let farm =
        "farm slurm scene.pbrt --tasks 4 --submit --sbatch=--partition=render -- --max-depth 3 --threads 1";
    let (status, said) = with_sbatch(&folder, farm);
    assert!(
        status == 0 && said.contains("4 tasks submitted; scene.exr is written when all are done"),
        "{said}"
    );
    assert_eq!(bytes(&folder, "scene.exr"), bytes(&folder, "whole.exr"));
    let log = fs::read_to_string(folder.path("sbatch.log")).unwrap();
    assert!(log.contains("--dependency=afterok:17 scene.farm/merge.sh"), "{log}");
    let script = fs::read_to_string(folder.path("scene.farm/render.sh")).unwrap();
    assert!(script.contains("#SBATCH --partition=render\n#SBATCH --array=0-3\n"), "{script}");
}

#[test]
fn a_task_that_is_killed_and_runs_again_changes_nothing() {
    let folder = folder();
    done(
        &folder,
        "farm slurm scene.pbrt --tasks 2 --spp 600 -o a.exr -- --size 20x14 --checkpoint-every 20ms",
    );
    let task = |index: &str| {
        let mut command = Command::new(folder.path("scene.farm/render.sh"));
        // As Kubernetes numbers the pods of an indexed job.
        command.env("JOB_COMPLETION_INDEX", index).env_remove("SLURM_ARRAY_TASK_ID");
        command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null());
        command
    };
    let mut killed = task("1").spawn().unwrap();
    until_there(&folder, "scene.farm/task.1.checkpoint");
    signal(killed.id(), "KILL");
    killed.wait().unwrap();
    assert!(!folder.path("scene.farm/task.1.part").exists());
    assert!(task("1").status().unwrap().success() && task("0").status().unwrap().success());
    assert!(Command::new(folder.path("scene.farm/merge.sh")).output().unwrap().status.success());
    done(&folder, "render scene.pbrt --spp 600 --size 20x14 -o b.exr");
    assert_eq!(bytes(&folder, "a.exr"), bytes(&folder, "b.exr"));
}

#[test]
fn what_cannot_be_shared_out_is_refused() {
    let folder = folder();
    refused(
        &folder,
        "farm slurm scene.pbrt --tasks 10",
        2,
        "--tasks 10 is more than the 9 samples per pixel (expected 9 or fewer)",
    );
    refused(
        &folder,
        "farm slurm a.glb --tasks 3 --frames 0..1 -o f.#.png",
        2,
        "--tasks 3 is more than the 2 frames (expected 2 or fewer)",
    );
    refused(
        &folder,
        "farm slurm scene.pbrt --tasks 2 --frames 0..1 -o f.#.png",
        2,
        "--frames needs an animation",
    );
    refused(&folder, "farm slurm a.glb --tasks 2 --frames 0..1 -o f.png", 2, "with # for the number");
    refused(&folder, "farm slurm scene.pbrt --tasks 2 -o scene.pbrt", 2, "expected the name of a picture");
    refused(&folder, "farm slurm none.pbrt --tasks 2", 4, "none.pbrt");
    assert!(!folder.path("scene.farm").exists());
}

#[test]
fn options_that_a_task_cannot_have_are_refused() {
    let folder = folder();
    // Scripts are run by hand, as where there is no scheduler.
    done(&folder, "farm slurm scene.pbrt --tasks 3 -- --spp 6 --max-depth 2");
    for task in ["0", "1", "2"] {
        let mut command = Command::new(folder.path("scene.farm/render.sh"));
        assert!(command.env("SLURM_ARRAY_TASK_ID", task).output().unwrap().status.success());
    }
    assert!(Command::new(folder.path("scene.farm/merge.sh")).output().unwrap().status.success());
    done(&folder, "render scene.pbrt --spp 6 --max-depth 2 -o whole.exr");
    assert_eq!(bytes(&folder, "scene.exr"), bytes(&folder, "whole.exr"));
    for option in [
        "-o x.exr",
        "--output x.exr",
        "--time 3s",
        "--noise 0.1",
        "--min-spp 3",
        "--noise 0.1 --min-spp 3",
        "--samples 0..2",
        "--resume",
        "--checkpoint x",
        "--frames 0..3",
        "--denoise",
        "--stats x.json",
        "--keep-sums",
        "--turntable 3",
        "--tev host",
        "--preview",
        "--spp 5",
        "--spp 0",
        "--progress json",
        "--no-checkpoint",
        "--nonsense",
        "--help",
        "--output-format png",
    ] {
        let (status, said) = folder.lumbre(
            &["farm", "slurm", "scene.pbrt", "--tasks", "3", "--spp", "6", "--"]
                .into_iter()
                .chain(option.split(' '))
                .collect::<Vec<_>>(),
        );
        assert!(status == 2 && said.contains("after --: "), "{option}: {status} {said}");
    }
}

#[test]
fn names_reach_scripts_quoted_or_are_refused() {
    let folder = folder();
    let scene = fs::read(folder.path("scene.pbrt")).unwrap();
    let farm = |scene: &str, more: &[&str]| {
        folder.lumbre(&[&["farm", "slurm", scene, "--tasks", "2", "--spp", "2"][..], more].concat())
    };
    for name in ["a\n#SBATCH --uid=0\n.pbrt", "a\r.pbrt", "a\u{85}.pbrt"] {
        fs::write(folder.path(name), &scene).unwrap();
        let (status, said) = farm(name, &[]);
        assert!(
            status == 2 && said.contains("a job script cannot hold this name"),
            "{name:?}: {status} {said}"
        );
        for (option, value) in [("--folder", name.to_owned()), ("-o", format!("{name}.png"))] {
            let (status, said) = farm("scene.pbrt", &[option, &value]);
            assert!(
                status == 2 && said.contains("a job script cannot hold this name"),
                "{option} {name:?}: {said}"
            );
        }
    }
    for more in [&["--sbatch=--x\nrm -rf y"][..], &["--", "--camera", "a\nrm -rf y"]] {
        let (status, said) = farm("scene.pbrt", more);
        assert!(status == 2 && said.contains("a job script cannot hold this name"), "{more:?}: {said}");
    }
    assert_eq!(farm("-", &[]).0, 2);
    // A dash before a name makes it no option of lumbre, sh or sbatch; quotes and dollars are letters like others.
    for name in ["-x.pbrt", "50%j 100%%.pbrt", "it's $(touch x) \"a\" `b`.pbrt"] {
        fs::write(folder.path(name), &scene).unwrap();
        let (stem, path) = (name.strip_suffix(".pbrt").unwrap(), format!("./{name}"));
        let (status, said) = farm(&path, &[&format!("-o={stem}.png"), &format!("--folder={stem}.farm")]);
        assert_eq!(status, 0, "{said}");
        for task in ["0", "1"] {
            let mut command = Command::new(folder.path(&format!("{stem}.farm/render.sh")));
            let out = command.env("SLURM_ARRAY_TASK_ID", task).output().unwrap();
            assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        }
        let out = Command::new(folder.path(&format!("{stem}.farm/merge.sh"))).output().unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        assert!(folder.path(&format!("{stem}.png")).exists() && !folder.path("x").exists());
        let submit = fs::read_to_string(folder.path(&format!("{stem}.farm/submit.sh"))).unwrap();
        assert!(!submit.contains(" '-") && !submit.contains(" -x"), "{submit}");
        // Slurm reads % in the names of logs alone.
        for (script, log) in [("render.sh", "%a"), ("merge.sh", "merge")] {
            let script = fs::read_to_string(folder.path(&format!("{stem}.farm/{script}"))).unwrap();
            let line = script.lines().find(|line| line.starts_with("#SBATCH --output=")).unwrap();
            let escaped = format!("{stem}.farm/{log}.log");
            let escaped = escaped.replace("50%j 100%%", "50%%j 100%%%%").replace('\'', r"'\''");
            assert!(line.contains(&escaped), "{line}");
            assert!(!script.contains("%%j") || script.matches("%%j").count() == 1, "{script}");
        }
    }
}

#[test]
fn only_scripts_and_pictures_of_lumbre_are_replaced() {
    let folder = folder();
    fs::create_dir(folder.path("scene.farm")).unwrap();
    for name in ["render.sh", "merge.sh", "submit.sh"] {
        folder.write(&format!("scene.farm/{name}"), "#!/bin/sh\necho mine\n");
        refused(
            &folder,
            "farm slurm scene.pbrt --tasks 2",
            2,
            &format!("scene.farm/{name}: not written by lumbre farm"),
        );
        assert_eq!(bytes(&folder, &format!("scene.farm/{name}")), b"#!/bin/sh\necho mine\n");
        assert_eq!(fs::read_dir(folder.path("scene.farm")).unwrap().count(), 1);
        fs::remove_file(folder.path(&format!("scene.farm/{name}"))).unwrap();
    }
    // A link is not followed to what is not there.
    std::os::unix::fs::symlink(folder.path("elsewhere"), folder.path("scene.farm/merge.sh")).unwrap();
    refused(&folder, "farm slurm scene.pbrt --tasks 2", 2, "not written by lumbre farm");
    fs::remove_file(folder.path("scene.farm/merge.sh")).unwrap();
    done(&folder, "farm slurm scene.pbrt --tasks 2");
    done(&folder, "farm slurm scene.pbrt --tasks 3");
    folder.write("scene.exr", "mine");
    refused(&folder, "farm slurm scene.pbrt --tasks 2", 2, "scene.exr exists and was not written by Lumbre");
    done(&folder, "farm slurm scene.pbrt --tasks 2 -o other.exr");
}

#[test]
fn an_image_behind_the_picture_is_named_to_the_merge() {
    let folder = folder();
    done(&folder, "farm slurm scene.pbrt --tasks 2 --spp 2 -o a.png -- --background wood.png");
    for task in ["0", "1"] {
        let mut command = Command::new(folder.path("scene.farm/render.sh"));
        assert!(command.env("SLURM_ARRAY_TASK_ID", task).output().unwrap().status.success());
    }
    assert!(Command::new(folder.path("scene.farm/merge.sh")).output().unwrap().status.success());
    done(&folder, "render scene.pbrt --spp 2 -o b.png --background wood.png");
    assert_eq!(bytes(&folder, "a.png"), bytes(&folder, "b.png"));
}

#[test]
fn logs_are_in_no_folder_whose_name_slurm_would_read_otherwise() {
    let folder = folder();
    refused(
        &folder,
        r"farm slurm scene.pbrt --tasks 2 --folder a\b",
        2,
        "expected --folder without backslashes",
    );
}
