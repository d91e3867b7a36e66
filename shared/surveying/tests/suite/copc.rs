//! Points in an octree.

use crate::support::{LasContent, options, street, utm, write_run};
use std::path::Path;
use surveying::{RunFolder, Tiling, write_copc, write_tiles};

fn deliver(run: &Path, out: &Path) -> LasContent {
    let run = RunFolder::open(run).expect("opens");
    let frame = utm(run.georeference.as_ref().expect("is placed"));
    std::fs::create_dir_all(out).expect("made");
    let file =
        write_copc(std::slice::from_ref(&run), &frame, &options(), out, "points.copc.laz", |_| ()).expect("writes");
    LasContent::read(&out.join(file.file))
}

#[test]
fn every_point_is_in_the_cube_of_its_node_and_those_of_the_run_are_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let out = folder.path().join("out");
    write_run(&run, &[(street(150_000), true)]);
    let copc = deliver(&run, &out);
    let bytes = &copc.bytes;
    let long = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().expect("8 bytes")) as usize;
    let double = |at: usize| f64::from_bits(long(at) as u64);
    let int = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes"));
    // The description of the octree is the first record.
    assert_eq!(&bytes[377..381], b"copc");
    let center = [429, 437, 445].map(double);
    let half = double(453);
    assert_eq!(double(461), half / 64.0, "spacing");
    let hierarchy_at = long(469);
    let hierarchy_bytes = long(477);
    assert_eq!(hierarchy_at + hierarchy_bytes, bytes.len());
    assert!(double(485) < double(493), "times");
    // Chunks are stored in the order of the table.
    let points_at = u32::from_le_bytes(bytes[96..100].try_into().expect("4 bytes")) as usize;
    let mut chunk_at = points_at + 8;
    let mut first = 0;
    let mut deepest = 0;
    let mut n_nodes = 0;
    for entry in (hierarchy_at..bytes.len()).step_by(32) {
        let level = int(entry);
        let cell = [4, 8, 12].map(|at| f64::from(int(entry + at)));
        assert_eq!(long(entry + 16), chunk_at);
        chunk_at += int(entry + 24) as usize;
        let n_points = int(entry + 28) as usize;
        assert!(n_points > 0);
        let side = 2.0 * half / f64::from(1 << level);
        for record in &copc.records[first..first + n_points] {
            let position = copc.position(record);
            for k in 0..3 {
                let low = center[k] - half + cell[k] * side;
                assert!((low - 1e-6..low + side).contains(&position[k]), "{position:?} in {level} {cell:?}");
            }
        }
        first += n_points;
        deepest = deepest.max(level);
        n_nodes += 1;
    }
    assert_eq!(first, 150_000);
    assert!(n_nodes > 3 && deepest >= 1, "{n_nodes} nodes, {deepest} levels");

    let opened = RunFolder::open(&run).expect("opens");
    let frame = utm(opened.georeference.as_ref().expect("is placed"));
    let tiling = Tiling { side_m: 0, is_compressed: false };
    let files =
        write_tiles(std::slice::from_ref(&opened), &frame, &options(), tiling, &out, |_| ()).expect("writes").files;
    let mut expected = LasContent::read(&out.join(&files[0].file)).records;
    let mut found = copc.records;
    expected.sort();
    found.sort();
    assert!(found == expected, "the octree has the records of the tiles");
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    write_run(&run, &[(street(40_000), true), (street(3000), true)]);
    let write = |n_threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads");
        pool.install(|| deliver(&run, &folder.path().join(n_threads.to_string()))).bytes
    };
    assert!(write(1) == write(3));
}
