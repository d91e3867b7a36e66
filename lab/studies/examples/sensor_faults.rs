//! Accuracy of the path with faulty inertial units and receivers: `sensor_faults TOWN RIG SEED SECONDS [FAULT ...]` simulates a drive and
//! runs the stage `slam_aggregate` on it once for each fault.
//!
//! Prints the error of the odometry at the end and its largest one over a second (m), the largest tilt of a placed submap (degrees),
//! the doubts, and the notes about the inertial unit and the receiver.

#[path = "../../../services/slam_aggregate/tests/suite/faulty_drive.rs"]
#[allow(dead_code, reason = "the tests of the stage use more of it")]
mod faulty_drive;

use faulty_drive::{Fault, SensorDrive};
use simulation::DriveSettings;
use slam_aggregate::Settings;

/// All faults by name.
const FAULTS: [(&str, Fault); 10] = [
    ("no_unit", Fault::NoUnit),
    ("none", Fault::None),
    ("degrees", Fault::Degrees),
    ("mirrored", Fault::Mirrored),
    ("mirrored_degrees", Fault::MirroredDegrees),
    ("late_50ms", Fault::Late(0.05)),
    ("late_100ms", Fault::Late(0.1)),
    ("bias_x", Fault::ForceBias([0.5, 0.0])),
    ("bias_y", Fault::ForceBias([0.0, 0.5])),
    ("fixes_late_500ms", Fault::LateFixes(0.5)),
];

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [town, rig, seed, seconds, wanted @ ..] = &arguments[..] else {
        anyhow::bail!("usage: sensor_faults TOWN RIG SEED SECONDS [FAULT ...]")
    };
    let settings = DriveSettings {
        town: town.parse()?,
        rig: rig.clone(),
        seed: seed.parse()?,
        seconds: seconds.parse()?,
        ..DriveSettings::default()
    };
    let drive = SensorDrive::simulated(&settings);
    for (name, fault) in FAULTS.iter().filter(|(name, _)| wanted.is_empty() || wanted.iter().any(|w| w == name)) {
        let found = drive.run(&Settings::default(), *fault);
        let path_m = found.path_m;
        println!(
            "{town} {rig} {seed}, {path_m:.0} m, {name}: end {:.3} m, second {:.3} m, tilt {:.2} deg, doubts {:?}",
            found.end_m, found.second_m, found.tilt_deg, found.doubts
        );
        let notes = found.notes.iter().filter(|note| note.contains("inertial unit:") || note.contains("late"));
        notes.for_each(|note| println!("    {note}"));
    }
    Ok(())
}
