//! The tables and keys of launch.toml that the supervisor reads itself.

use crate::remap::{PlainNames, Remap};
use run::{Mode, Remote};
use settings::{any, one_word, within, zero_or_within};
use std::path::Path;

settings::settings! {
    /// `[run]`: input, output and supervision of the run.
    pub struct Run {
        /// Folder of the drive.
        pub drive: String = String::new() => any();
        /// Folder of the results.
        pub output: String = String::new() => any();
        /// Live: drive.toml with the mounting of the sensors, or a drive folder with one. Empty: the manifest of
        /// `drive` unless the drive is simulated; without any, the LiDAR is assumed upright at the origin of the body
        /// frame.
        pub rig: String = String::new() => any();
        /// `offline`: lossless and deterministic, from the drive. `live`: from the sensors, newest data first.
        pub mode: Mode = Mode::Offline => one_word();
        /// Drive time between barriers, s: the most that is repeated after a crash. 0: 20 offline, 5 live.
        pub barrier_s: f64 = 0.0 => zero_or_within(0.1, 3600.0);
        /// Consecutive restarts without progress before the run is given up. Each new barrier that all stages complete resets
        /// the counter.
        pub restarts: u32 = 3 => within(0, 1000);
        /// Pause before the first restart, s; doubled with each further restart without a new barrier, up to 30 s.
        pub restart_delay_s: f64 = 0.5 => within(0.0, 30.0);
        /// A stage hangs if it sends no heartbeat for this long, s; there are five heartbeats a second.
        pub hang_s: f64 = 5.0 => within(1.0, 3600.0);
        /// A stage stalls if it spends this long in one step, s. A stage's own table may set another limit.
        pub stall_s: f64 = 60.0 => within(1.0, 86400.0);
        /// Whether `replica report` writes report.html and report.json at the end of the run.
        pub report: bool = true => any();
    }
}

impl Run {
    /// Drive time between barriers, s. A state has all unfinished submaps, some 100 MB: offline, where 20 s of drive
    /// are repeated in a few seconds, rarer barriers write less to the disk. Live, a restarted stage lacks the messages
    /// since its last barrier.
    pub fn barrier_s(&self) -> f64 {
        match self.barrier_s {
            0.0 if self.mode == Mode::Live => 5.0,
            0.0 => 20.0,
            seconds => seconds,
        }
    }
}

settings::settings! {
    /// Keys of a stage's table that the supervisor reads.
    pub struct StageTable {
        /// `HOST:PORT` of the `replica agent` that runs the stage on another host; empty: this host.
        pub host: String = String::new() => any();
        /// Key file of `host`, which only its owner may read. A relative path is relative to the launch file.
        pub host_key: String = "agent.key".to_owned() => any();
        /// The stage's program; default `replica-<table>` in the folder of replica-launch. With `host`, a path in the
        /// folder of the agent.
        pub program: String = String::new() => any();
        /// Interpreter of a program `*.py`: a command, or a path relative to the launch file.
        pub python: String = "python3".to_owned() => any();
        /// Topics of the run for topics of the program, where the names differ: `{ class = "class_b" }`; for an input
        /// also several.
        pub remap: Remap = Remap::default() => PlainNames;
        /// A stage stalls if it spends this long in one step, s; 0 = the limit of `[run]`.
        pub stall_s: f64 = 0.0 => within(0.0, 86400.0);
        /// Threads of its parallel loops; 0 = one per core.
        pub threads: usize = 0 => within(0, 1024);
    }
}

impl StageTable {
    /// The other host of the stage, if it has one. `folder` is the folder of the launch file.
    pub fn remote(&self, folder: &Path, hang_s: f64) -> Option<Remote> {
        (!self.host.is_empty()).then(|| Remote {
            host: self.host.clone(),
            key: folder.join(&self.host_key),
            program: self.program.clone(),
            python: self.python.clone(),
            threads: self.threads,
            hang_s,
            files: [].into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use settings::parse_table;
    use settings::toml::de::DeTable;

    fn run_table(text: &str) -> Result<Run, Vec<String>> {
        let table = DeTable::parse(text).expect("TOML");
        let (run, problems) = parse_table::<Run>(table.get_ref());
        let texts: Vec<String> = problems.into_iter().map(|problem| problem.text).collect();
        if texts.is_empty() { Ok(run) } else { Err(texts) }
    }

    #[test]
    fn time_between_barriers_depends_on_the_mode_unless_it_is_given() {
        let seconds = |text: &str| run_table(text).expect("valid").barrier_s();
        assert_eq!(seconds(""), 20.0);
        assert_eq!(seconds("mode = \"live\""), 5.0);
        assert_eq!(seconds("mode = \"live\"\nbarrier_s = 0.5"), 0.5);
        let refused = run_table("barrier_s = 0.05").expect_err("refused");
        assert!(refused[0].contains("must be 0 or between 0.1 and 3600"), "{refused:?}");
    }
}
