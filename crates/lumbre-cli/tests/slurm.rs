//! A farm of one machine by Slurm itself, where its programs are installed and may be started.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::files::Folder;
use crate::parts::{bytes, done, folder, until_there};

/// Its daemons, on ports and in folders of their own, until they are dropped.
struct Slurm {
    daemons: Vec<Child>,
    configuration: std::path::PathBuf,
}

impl Drop for Slurm {
    fn drop(&mut self) {
        let _ = self.command("scancel").arg("--user=root").status();
        for daemon in self.daemons.iter_mut().rev() {
            let _ = Command::new("kill").arg(daemon.id().to_string()).status();
            let _ = daemon.wait();
        }
    }
}

impl Slurm {
    /// `None` where it is not installed, or this is not the user that may start it.
    fn start(folder: &Folder) -> Option<Self> {
        let is_there = |program: &str| {
            Command::new(program).arg("-V").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok()
        };
        let is_root = Command::new("id").arg("-u").output().is_ok_and(|out| out.stdout == b"0\n");
        if !is_root || !["slurmctld", "slurmd", "sbatch", "munged"].into_iter().all(is_there) {
            return None;
        }
        let at = |name: &str| folder.path(name).display().to_string();
        for name in ["slurm", "slurm/state", "slurm/spool", "munge"] {
            fs::create_dir(folder.path(name)).unwrap();
        }
        fs::write(folder.path("munge/key"), [b'k'; 128]).unwrap();
        for (name, mode) in [("munge/key", 0o400), ("munge", 0o755)] {
            fs::set_permissions(folder.path(name), fs::Permissions::from_mode(mode)).unwrap();
        }
        let host = Command::new("hostname").arg("-s").output().unwrap();
        let host = String::from_utf8(host.stdout).unwrap().trim().to_owned();
        // Ports that no one else is likely to have.
        let port = 20_000 + (std::process::id() % 20_000) as u16;
        let text = format!(
            "ClusterName=one\nSlurmctldHost={host}(127.0.0.1)\nSlurmUser=root\nSlurmctldPort={port}\nSlurmdPort={}\n\
             AuthType=auth/munge\nAuthInfo=socket={}\nCredType=cred/munge\nStateSaveLocation={}\nSlurmdSpoolDir={}\n\
             SlurmctldPidFile={}\nSlurmdPidFile={}\nProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\n\
             SwitchType=switch/none\nMpiDefault=none\nReturnToService=2\nJobAcctGatherType=jobacct_gather/none\n\
             AccountingStorageType=accounting_storage/none\nSelectType=select/cons_tres\nSelectTypeParameters=CR_CPU\n\
             SchedulerParameters=sched_interval=1,sched_min_interval=0,batch_sched_delay=0,bf_interval=1\n\
             MinJobAge=2\nKillWait=1\n\
             NodeName={host} NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN\nPartitionName=all Nodes={host} Default=YES State=UP\n",
            port + 1,
            at("munge/socket"),
            at("slurm/state"),
            at("slurm/spool"),
            at("slurm/ctld.pid"),
            at("slurm/d.pid"),
        );
        folder.write("slurm/slurm.conf", &text);
        let mut slurm = Self { daemons: Vec::new(), configuration: folder.path("slurm/slurm.conf") };
        let munge = [
            "key-file=munge/key",
            "socket=munge/socket",
            "pid-file=munge/pid",
            "log-file=munge/log",
            "seed-file=munge/seed",
        ]
        .map(|option| {
            let (name, value) = option.split_once('=').unwrap();
            format!("--{name}={}", at(value))
        });
        slurm.daemon(folder, "munged", &["--foreground", "--force"], &munge);
        until(|| folder.path("munge/socket").exists())?;
        slurm.daemon(folder, "slurmctld", &["-D", "-c"], &[]);
        slurm.daemon(folder, "slurmd", &["-D"], &[]);
        let is_up = until(|| {
            let state = slurm.command("sinfo").args(["-h", "-o", "%t"]).output();
            state.is_ok_and(|out| out.stdout.starts_with(b"idle"))
        });
        if is_up.is_none() {
            println!("{}", fs::read_to_string(folder.path("slurmctld.log")).unwrap_or_default());
        }
        is_up.map(|()| slurm)
    }

    fn daemon(&mut self, folder: &Folder, program: &str, arguments: &[&str], more: &[String]) {
        let log = fs::File::create(folder.path(&format!("{program}.log"))).unwrap();
        let mut command = self.command(program);
        command.args(arguments).args(more).stdout(log.try_clone().unwrap()).stderr(log);
        self.daemons.push(command.spawn().unwrap());
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command.env("SLURM_CONF", &self.configuration).stdin(Stdio::null());
        command
    }
}

/// Whether something comes about in time.
fn until(comes: impl Fn() -> bool) -> Option<()> {
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(60) {
        if comes() {
            return Some(());
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    None
}

#[test]
fn slurm_gives_the_file_of_one_run_despite_a_killed_task() {
    let folder = folder();
    let Some(slurm) = Slurm::start(&folder) else {
        println!("skipped: Slurm is not installed, or cannot be started");
        return;
    };
    let farm = "farm slurm scene.pbrt --tasks 3 --spp 900 -o a.exr --submit -- --size 24x16 --threads 1 --checkpoint-every 20ms";
    let arguments: Vec<&str> = farm.split_whitespace().collect();
    let submitted = folder.command(&arguments).env("SLURM_CONF", &slurm.configuration).output().unwrap();
    assert!(submitted.status.success(), "{}", String::from_utf8_lossy(&submitted.stderr));
    // A task is taken from its node in the middle of its work, and runs again.
    until_there(&folder, "scene.farm/task.0.checkpoint");
    let jobs = slurm.command("squeue").args(["-h", "-r", "-o", "%i %t"]).output().unwrap();
    let jobs = String::from_utf8(jobs.stdout).unwrap();
    let first = jobs.lines().find_map(|line| line.split_whitespace().next().filter(|id| id.ends_with("_0")));
    let first = first.unwrap_or_else(|| panic!("no first task: {jobs}"));
    assert!(slurm.command("scontrol").args(["requeue", first]).status().unwrap().success());
    let turn = std::cell::Cell::new(0);
    let is_done = until(|| {
        turn.set(turn.get() + 1);
        if turn.get() % 30 != 0 {
            return folder.path("a.exr").exists();
        }
        // It would wait for two minutes.
        let _ =
            slurm.command("scontrol").args(["update", &format!("JobId={first}"), "StartTime=now"]).output();
        folder.path("a.exr").exists()
    });
    if is_done.is_none() {
        let queue = slurm.command("squeue").output().unwrap();
        panic!("{}\n{:?}", String::from_utf8_lossy(&queue.stdout), folder.names());
    }
    done(&folder, "render scene.pbrt --spp 900 --size 24x16 -q -o b.exr");
    assert_eq!(bytes(&folder, "a.exr"), bytes(&folder, "b.exr"));
}
