//! A render shared out by a scheduler comes to the file of one machine.

#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::Command;

use crate::files::{Folder, answer};
use crate::parts::{bytes, done, folder, refused, signal, until_there};

/// A scheduler that runs at once what it is given: the tasks of an array from the last to the first, the first of them twice.
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
    assert!(status == 0 && said.contains("4 tasks submitted; scene.exr comes when all are done"), "{said}");
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
    refused(&folder, "farm slurm scene.pbrt --tasks 10", 2, "found 10 for 9 samples; expected 9 or fewer");
    refused(&folder, "farm slurm scene.pbrt --tasks 3 --frames 0..1 -o f.#.png", 2, "found 3 for 2 frames");
    refused(&folder, "farm slurm scene.pbrt --tasks 2 --frames 0..1 -o f.png", 2, "with # for the number");
    refused(&folder, "farm slurm scene.pbrt --tasks 2 -o scene.pbrt", 2, "expected the name of a picture");
    refused(&folder, "farm slurm none.pbrt --tasks 2", 4, "none.pbrt");
    assert!(!folder.path("scene.farm").exists());
}
