//! Points in tiles.

use crate::support::{BEGIN_S, LasContent, gps_time_s, options, street, time_s, utm, write_run};
use std::path::Path;
use surveying::{LeftOut, RunFolder, TargetFrame, Tiling, WrittenTiles, write_tiles};

const LAZ_20_M: Tiling = Tiling { side_m: 20, is_compressed: true };
/// From Unix time to adjusted standard GPS time, with 18 leap seconds.
const ADJUSTED_S: f64 = 315_964_800.0 + 1e9 - 18.0;

fn deliver(run: &Path, out: &Path, tiling: Tiling) -> WrittenTiles {
    let run = RunFolder::open(run).expect("opens");
    let frame = utm(run.georeference.as_ref().expect("is placed"));
    std::fs::create_dir_all(out).expect("made");
    write_tiles(std::slice::from_ref(&run), &frame, &options(), tiling, out, |_| ()).expect("writes")
}

/// Numbers of the cloud and of the point in it, by the time of a record.
fn cloud_and_point(record: &[u8]) -> (usize, usize) {
    let unix_s = gps_time_s(record) + ADJUSTED_S;
    let seq = (unix_s - BEGIN_S as f64) as usize;
    (seq, ((unix_s - time_s(seq, 0)) * 1e5).round() as usize)
}

#[test]
fn points_lie_by_sweep_and_laser_and_then_in_their_order() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let out = folder.path().join("out");
    write_run(&run, &[(street(1000), true)]);
    let files = deliver(&run, &out, Tiling { side_m: 0, is_compressed: true }).files;
    let places = LasContent::read(&out.join(&files[0].file))
        .records
        .iter()
        .map(|record| {
            // Laser and frame behind class, score, laser, moving, camera and instance.
            let frame = u32::from_le_bytes(record[45..49].try_into().expect("4 bytes"));
            (frame, record[38], cloud_and_point(record).1)
        })
        .collect::<Vec<_>>();
    assert!(places.is_sorted() && places.len() == 1000, "{places:?}");
}

#[test]
fn every_point_is_in_its_tile_once_with_its_values() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let out = folder.path().join("out");
    let points = street(1000);
    write_run(&run, &[(points[..600].to_vec(), true), (points[600..].to_vec(), true)]);
    let WrittenTiles { files, left_out } = deliver(&run, &out, LAZ_20_M);
    assert_eq!(left_out, LeftOut::default());
    assert!(files.len() >= 3, "{files:?}");
    let opened = RunFolder::open(&run).expect("opens");
    let frame = utm(opened.georeference.as_ref().expect("is placed"));
    let mut seen = vec![0; points.len()];
    for file in &files {
        let content = LasContent::read(&out.join(&file.file));
        let (corner_x, corner_y) = file.file.trim_end_matches(".laz").split_once('_').expect("two numbers");
        let corner: [f64; 2] = [corner_x, corner_y].map(|text| text.parse().expect("a number"));
        assert_eq!(content.records.len() as u64, file.n_points);
        for record in &content.records {
            let position = content.position(record);
            assert!((0..2).all(|k| (corner[k]..corner[k] + 20.0).contains(&position[k])), "{position:?} in {corner:?}");
            let (seq, i) = cloud_and_point(record);
            let number = seq * 600 + i;
            seen[number] += 1;
            let (xyz, class) = points[number];
            let expected = frame.from_cloud(xyz).expect("converts");
            assert!((0..3).all(|k| (position[k] - expected[k]).abs() < 6e-4), "{position:?}, expected {expected:?}");
            let asprs = if class == 7 { 11 } else { 6 };
            assert_eq!((record[12], record[14], record[16]), ((i % 256) as u8, 0x11, asprs));
            assert_eq!(record[20..22], (seq as u16 + 1).to_le_bytes());
            assert_eq!(record[30..36], [0, 10, 0, 20, 0, (i % 100) as u8]);
            // Class, score, laser, moving, camera; instance, frame.
            assert_eq!(record[36..41], [class, 200, (i % 32) as u8, u8::from(i.is_multiple_of(5)), 3]);
            assert_eq!(record[41..45], ((i % 4) as u32).to_le_bytes());
            assert_eq!(record[45..49], ((seq * 100 + i / 50) as u32).to_le_bytes());
        }
    }
    assert!(seen.iter().all(|n| *n == 1), "every point is there once");
}

#[test]
fn las_and_laz_have_the_same_records_for_any_number_of_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    write_run(&run, &[(street(5000), true)]);
    let write = |name: &str, n_threads: usize, is_compressed: bool| {
        let out = folder.path().join(name);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads");
        let files = pool.install(|| deliver(&run, &out, Tiling { side_m: 0, is_compressed })).files;
        assert_eq!(files.len(), 1);
        LasContent::read(&out.join(&files[0].file))
    };
    let laz = write("a", 1, true);
    let again = write("b", 3, true);
    let las = write("c", 2, false);
    assert!(laz.bytes == again.bytes, "the bytes do not depend on threads");
    assert_eq!(laz.records, las.records);
    assert_eq!(laz.records.len(), 5000);
}

#[test]
fn points_without_place_or_finite_coordinates_are_counted() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let out = folder.path().join("out");
    let mut points = street(100);
    points[7].0[1] = f64::NAN;
    points[8].0[2] = f64::INFINITY;
    write_run(&run, &[(points, true), (street(30), false)]);
    let WrittenTiles { files, left_out } = deliver(&run, &out, LAZ_20_M);
    assert_eq!(left_out, LeftOut { without_place: 30, not_finite: 2 });
    assert_eq!(files.iter().map(|file| file.n_points).sum::<u64>(), 98);
}

#[test]
fn local_coordinates_are_those_of_the_clouds_without_reference_system() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let out = folder.path().join("out");
    let points = street(50);
    write_run(&run, &[(points.clone(), true)]);
    std::fs::create_dir(&out).expect("made");
    let opened = RunFolder::open(&run).expect("opens");
    let frame = TargetFrame::local(opened.georeference.as_ref());
    let mut options = options();
    options.note = "not georeferenced: a reason".to_owned();
    let tiling = Tiling { side_m: 0, is_compressed: false };
    let files =
        write_tiles(std::slice::from_ref(&opened), &frame, &options, tiling, &out, |_| ()).expect("writes").files;
    let content = LasContent::read(&out.join(&files[0].file));
    assert_eq!(content.records.len(), points.len());
    for record in &content.records {
        let xyz = points[cloud_and_point(record).1].0;
        let position = content.position(record);
        assert!((0..3).all(|k| (position[k] - xyz[k]).abs() < 6e-4), "{position:?} {xyz:?}");
    }
    let text = String::from_utf8_lossy(&content.bytes[..2000]).into_owned();
    assert!(text.contains("not georeferenced: a reason") && !text.contains("PROJCS"), "{text}");
}
