//! Post-processed trajectories next to the files of a drive.

use super::support::{folder, import_from, write_file};
use drive::Drive;
use drive::manifest::TrajectoryFormat;
use formats::cloud::CloudPoint;
use formats::pcd::pcd_from_points;
use formats::sbet::SbetRecord;

#[test]
fn single_trajectory_is_linked_and_several_are_named() {
    let folder = folder();
    let source = folder.path().join("source");
    let points: Vec<CloudPoint> = (0..3).map(|i| CloudPoint { x: 5.0, y: i as f32, z: 0.5, intensity: 40.0 }).collect();
    for stamp in ["1583836591182590976", "1583836591282590976"] {
        write_file(&source.join(format!("{stamp}.pcd")), pcd_from_points(&points));
    }
    let record = |k: i32| SbetRecord { time_s: f64::from(k), latitude_rad: 0.8, ..SbetRecord::default() };
    let sbet: Vec<u8> = (0..5).flat_map(|k| record(k).to_bytes()).collect();
    write_file(&source.join("sbet_mission.out"), &sbet);
    write_file(&source.join("smrmsg_mission.out"), [0; 160]);
    let mut import = import_from(&source, &folder);
    let report = import.run().expect("imports").join("\n");
    assert!(report.contains("imported: the trajectory sbet_mission.out"), "{report}");
    let drive = Drive::open(&import.out).expect("opens");
    let entry = drive.manifest().trajectory.clone().expect("has a trajectory");
    assert_eq!((entry.file.as_str(), entry.format), ("trajectory/sbet_mission.out", TrajectoryFormat::Sbet));
    assert_eq!(entry.deviations.as_deref(), Some("trajectory/smrmsg_mission.out"));

    let table = "GPSTime,Latitude,Longitude,H-Ell,Roll,Pitch,Heading\n1,48,2,100,0,0,0\n2,48,2,100,0,0,0\n";
    write_file(&source.join("export.txt"), table);
    import.out = folder.path().join("second");
    let report = import.run().expect("imports").join("\n");
    assert!(report.contains("several trajectories (export.txt, sbet_mission.out)"), "{report}");
    assert!(Drive::open(&import.out).expect("opens").manifest().trajectory.is_none());
}
