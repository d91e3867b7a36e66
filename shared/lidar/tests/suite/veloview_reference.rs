//! A revolution of a real HDL-32E capture, exported by VeloView (the manufacturer's viewer), is the reference.

use flate2::read::GzDecoder;
use lidar::{SweepPoint, SweepReader};
use std::fs::File;
use std::io::{BufRead, BufReader};

/// x, y, z in the axes of the viewer, and intensity.
fn viewer_points(path: &std::path::Path) -> Vec<[f64; 4]> {
    let lines = BufReader::new(GzDecoder::new(File::open(path).expect("opens"))).lines();
    let numbers = |line: String| -> [f64; 4] {
        let fields: Vec<f64> = line.split(',').map(|field| field.parse().expect("a number")).collect();
        fields.try_into().expect("four fields")
    };
    lines.skip(1).map(|line| numbers(line.expect("reads"))).collect()
}

#[real_data::test("velodyne/hdl32e_outdoor.pcap", "velodyne/hdl32e_outdoor_frame1_veloview.csv.gz")]
fn decoded_revolution_equals_veloview_export() {
    let capture = real_data::path("velodyne/hdl32e_outdoor.pcap");
    let export = real_data::path("velodyne/hdl32e_outdoor_frame1_veloview.csv.gz");
    let mut reader = SweepReader::open(vec![capture], None).expect("opens");
    reader.next_sweep(|_| {}).expect("reads").expect("revolution 0");
    let mut returns: Vec<SweepPoint> = Vec::new();
    let info = reader.next_sweep(|chunk| returns.extend_from_slice(chunk)).expect("reads").expect("revolution 1");
    assert_eq!((info.seq, info.n_returns, info.lost_packets), (1, 47_962, 0));

    let expected = viewer_points(&export);
    assert_eq!(returns.len(), expected.len());
    let mut sum = 0.0;
    let mut worst = 0.0_f64;
    for (i, (ours, theirs)) in returns.iter().zip(&expected).enumerate() {
        assert_eq!(f64::from(ours.intensity), theirs[3], "point {i}");
        // Their y is forward, their x right.
        let d = [f64::from(ours.x) - theirs[1], f64::from(ours.y) + theirs[0], f64::from(ours.z) - theirs[2]];
        let distance = d.iter().map(|d| d * d).sum::<f64>().sqrt();
        sum += distance;
        worst = worst.max(distance);
    }
    let mean = sum / expected.len() as f64;
    eprintln!("{} points: mean {:.4} mm, worst {:.3} mm", expected.len(), mean * 1e3, worst * 1e3);
    // The viewer adds up firing times in floating point. Angles of exactly half a count (one laser in sixteen) are rounded up
    // here and up or down there; one count is 17 mm at 100 m.
    assert!(mean < 0.3e-3 && worst < 18e-3, "mean {mean} m, worst {worst} m");
}
