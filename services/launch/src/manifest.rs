//! The tables and keys of launch.toml that the supervisor reads itself.

use ipc::Transport;
use run::toml::Spanned;
use run::toml::de::DeValue;
use run::{Field, SettingError, Settings, any, one_of, within};
use serde::Serialize;
use serde::de::IntoDeserializer;
use simulation::{DriveSettings, SettingField, SimulatedDrive};
use std::path::Path;

run::settings! {
    /// `[run]`: input, output and supervision of the run.
    pub struct Run {
        /// Folder of the drive.
        pub drive: String = String::new() => any();
        /// Folder of the results.
        pub output: String = String::new() => any();
        /// Live: drive.toml with the mounting of the sensors, or a drive folder with one. Empty: that of `drive` unless the drive is
        /// simulated; without any, the LiDAR is taken as upright at the origin of the body frame.
        pub rig: String = String::new() => any();
        /// `offline`: lossless and deterministic, from the drive. `live`: from the sensors, newest data first.
        pub mode: String = "offline".to_owned() => one_of(&["offline", "live"]);
        /// Transport of messages: shared memory, or, for comparison only, copies through sockets. The results are the same.
        pub transport: String = "shared".to_owned() => one_of(&["shared", "copying"]);
        /// Drive time between barriers, s: the most that is repeated after a crash.
        pub barrier_s: f64 = 5.0 => within(0.1, 3600.0);
        /// Consecutive restarts without progress before the run is given up. Each new barrier that all stages complete resets
        /// the counter.
        pub restarts: u32 = 3 => within(0, 1000);
        /// Pause before the first restart, s; doubled with each further restart without a new barrier, up to 30 s.
        pub restart_delay_s: f64 = 0.5 => within(0.0, 30.0);
        /// A stage without a heartbeat for this long hangs, s; there are five heartbeats a second.
        pub hang_s: f64 = 5.0 => within(1.0, 3600.0);
        /// A stage that spends this long in one step stalls, s. A stage's own table may set another limit.
        pub stall_s: f64 = 60.0 => within(1.0, 86400.0);
    }
}

impl Run {
    /// The key `transport`.
    pub fn transport(&self) -> Transport {
        if self.transport == "copying" { Transport::Copying } else { Transport::Shared }
    }
}

/// `[simulate]`: the drive that `replica simulate` makes if the drive of `[run]` does not exist.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Simulate(DriveSettings);

impl Simulate {
    /// In what a simulated drive differs from this table; empty if the drive has no mark of the simulation.
    pub fn differences(&self, drive: &Path) -> Vec<String> {
        SimulatedDrive::read(drive).map(|simulated| simulated.differences(&self.0)).unwrap_or_default()
    }

    /// Arguments of `replica`, without the folder to make.
    pub fn arguments(&self) -> Vec<String> {
        self.0.arguments()
    }
}

impl Settings for Simulate {
    fn fields() -> Vec<Field> {
        let field = |SettingField { key, kind, default, rule, meaning }| Field {
            key: String::from(key),
            kind: String::from(kind),
            default,
            rule,
            meaning: String::from(meaning),
        };
        DriveSettings::fields().into_iter().map(field).collect()
    }
    fn set(&mut self, key: &str, value: Spanned<DeValue<'_>>) -> Option<Result<(), SettingError>> {
        let result = self.0.set(key, value.into_deserializer())?;
        Some(result.map_err(|error| SettingError::Other(error.text())))
    }
}

run::settings! {
    /// Keys of a stage's table that the supervisor reads.
    pub struct StageTable {
        /// The stage's program; default `replica-<table>` beside replica-launch.
        pub program: String = String::new() => any();
        /// A stage that spends this long in one step stalls, s; 0 = the limit of `[run]`.
        pub stall_s: f64 = 0.0 => within(0.0, 86400.0);
        /// Threads of its parallel loops; 0 = one per core.
        pub threads: usize = 0 => within(0, 1024);
    }
}
