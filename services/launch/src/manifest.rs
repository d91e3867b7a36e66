//! The tables of launch.toml that are the supervisor's own.

use ipc::Transport;
use stage::{any, one_of, within};

stage::settings! {
    /// `[run]`: what the whole run works on and how it is watched.
    pub struct Run {
        /// Folder of the drive.
        pub drive: String = String::new() => any();
        /// Folder of the results.
        pub output: String = String::new() => any();
        /// `offline`: lossless and deterministic, from the drive. `live`: newest first, from the sensors; the drive, if
        /// given, says where they are mounted.
        pub mode: String = "offline".to_owned() => one_of(&["offline", "live"]);
        /// How messages travel: shared memory, or, for comparison only, copies through sockets. The results are the same.
        pub transport: String = "shared".to_owned() => one_of(&["shared", "copying"]);
        /// Drive time between barriers, s: what a crash may cost to do again.
        pub barrier_s: f64 = 5.0 => within(0.1, 3600.0);
        /// Restarts of the whole run from its last barrier before it is given up. With each new barrier that all stages
        /// reach they are counted anew: a run of days that loses a stage a day gets on.
        pub restarts: u32 = 3 => within(0, 1000);
        /// Pause before the first restart, s; doubled with each further one without a new barrier, up to 30 s.
        pub restart_delay_s: f64 = 0.5 => within(0.0, 30.0);
        /// A stage without a heartbeat for so long hangs, s. Twenty-five beats.
        pub hang_s: f64 = 5.0 => within(1.0, 3600.0);
        /// A stage that is in one step for so long stalls, s. A stage's own table may say otherwise.
        pub stall_s: f64 = 60.0 => within(1.0, 86400.0);
    }
}

impl Run {
    /// The key `transport`.
    pub fn transport(&self) -> Transport {
        if self.transport == "copying" { Transport::Copying } else { Transport::Shared }
    }
}

stage::settings! {
    /// `[simulate]`: the drive that is made if the one of `[run]` is not there, as `replica simulate` makes it.
    pub struct Simulate {
        /// Kind of town.
        pub town: String = "urban".to_owned() => one_of(&["urban", "suburban", "rural", "field", "tunnel"]);
        /// Another seed, another town.
        pub seed: u64 = 1 => any();
        /// Length of the drive, s.
        pub seconds: f64 = 12.0 => within(0.2, 600.0);
        /// The vehicle: l3d2, nuscenes, kitti, or a rig file, its path seen from the launch file's folder.
        pub rig: String = "l3d2".to_owned() => any();
        /// How far sensors are turned from where drive.toml says, degrees (standard deviation).
        pub calibration_error_deg: f64 = 0.0 => within(0.0, 10.0);
        /// How far they are shifted, cm (standard deviation along each axis).
        pub calibration_error_cm: f64 = 0.0 => within(0.0, 100.0);
        /// Exposure of the mosaic cameras, ms.
        pub mosaic_exposure_ms: f64 = 5.0 => within(0.1, 1000.0);
        /// Write which cameras saw each return, too; takes as long as the rest.
        pub truth_visibility: bool = false => any();
    }
}

impl Simulate {
    /// What `replica` is called with, but for the folder to make.
    pub fn arguments(&self) -> Vec<String> {
        let Self { calibration_error_deg: deg, calibration_error_cm: cm, .. } = self;
        let mut arguments = vec!["simulate".to_owned()];
        for (name, value) in [
            ("--town", self.town.clone()),
            ("--seed", self.seed.to_string()),
            ("--seconds", self.seconds.to_string()),
            ("--rig", self.rig.clone()),
            ("--calibration-error", format!("{deg},{cm}")),
            ("--mosaic-exposure-ms", self.mosaic_exposure_ms.to_string()),
        ] {
            arguments.extend([name.to_owned(), value]);
        }
        arguments.extend(self.truth_visibility.then(|| "--truth-visibility".to_owned()));
        arguments
    }
}

stage::settings! {
    /// Keys of a stage's table that are for the supervisor.
    pub struct StageTable {
        /// The stage's program; default `replica-<table>` beside replica-launch.
        pub program: String = String::new() => any();
        /// In one step for so long it stalls, s; 0 = as `[run]` says.
        pub stall_s: f64 = 0.0 => within(0.0, 86400.0);
        /// Threads of its parallel loops; 0 = as many as cores.
        pub threads: usize = 0 => within(0, 1024);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_of_simulate_becomes_an_argument() {
        let simulate = Simulate {
            town: "rural".to_owned(),
            seed: 7,
            seconds: 0.5,
            rig: "rigs/mine.toml".to_owned(),
            calibration_error_deg: 0.2,
            calibration_error_cm: 1.5,
            mosaic_exposure_ms: 100.0,
            truth_visibility: true,
        };
        let expected = "simulate --town rural --seed 7 --seconds 0.5 --rig rigs/mine.toml --calibration-error 0.2,1.5 \
                        --mosaic-exposure-ms 100 --truth-visibility";
        assert_eq!(simulate.arguments().join(" "), expected);
        let default = Simulate::default().arguments();
        assert_eq!(default.len(), 13, "{default:?}");
    }
}
