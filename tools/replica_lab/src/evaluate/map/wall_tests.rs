//! Scores of simulated walls.

use super::*;
use clap::Parser;
use command_line::argument::Cli;
use formats::ply::{Header, Kind, PlyWriter, Row};

/// Two sheets of points `half` m in front of and behind a wall of 6 x 3 m at y = `y`, far from the origin, as in UTM. Every tenth
/// point is flagged as dynamic and lies 1 m in front.
fn write_wall(path: &Path, y: f64, half: f64) {
    let header = Header::new([("x", Kind::Double), ("y", Kind::Double), ("z", Kind::Double), ("dynamic", Kind::UChar)]);
    let n = 300 * 150;
    let mut writer = PlyWriter::create(path, &header, n).expect("creates");
    let encode = |i: usize, row: &mut Row<'_>| {
        let is_dynamic = i.is_multiple_of(10);
        let side = if i.is_multiple_of(2) { half } else { -half } - if is_dynamic { 1.0 } else { 0.0 };
        row.f64(452_000.0 + (i % 300) as f64 * 0.02).f64(5_411_000.0 + y + side).f64((i / 300) as f64 * 0.02);
        row.u8(u8::from(is_dynamic));
    };
    writer.write_each(n, encode).expect("writes");
    writer.finish().expect("finishes");
}

#[test]
fn thickness_and_distance_match_the_walls() {
    let folder = tempfile::tempdir().expect("a folder");
    let [crisp, blurred] = ["crisp.ply", "blurred.ply"].map(|name| folder.path().join(name));
    write_wall(&crisp, 0.0, 0.005);
    write_wall(&blurred, 0.06, 0.03);
    let out = folder.path().join("out");
    let words = [&blurred, &crisp, Path::new("--truth"), &crisp, Path::new("--static-only"), Path::new("--out"), &out];
    let words = words.map(|word| word.to_string_lossy().into_owned());
    let args = Cli::parse_from([&[String::new()], &words[..]].concat()).args;
    run(&args).expect("runs");
    let json = std::fs::read_to_string(out.join("map.json")).expect("is there");
    let maps: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let number =
        |map: usize, path: &str| maps[map].pointer(path).and_then(serde_json::Value::as_f64).expect("a number");
    for (map, thickness, distance) in [(0, 0.03, 0.06), (1, 0.005, 0.0)] {
        assert_eq!(number(map, "/points"), 40_500.0);
        assert!((number(map, "/facade_thickness_m/median") - thickness).abs() < 0.001, "{json}");
        // The sheets of the first wall are at 3 and 9 cm, the sheets of the second at -0.5 and 0.5 cm.
        assert!((number(map, "/cloud_to_truth/near_m/mean") - distance).abs() < 0.006, "{json}");
    }
    assert!(number(0, "/mean_map_entropy") > number(1, "/mean_map_entropy") + 1.0, "{json}");
    assert!(out.join("top_0.png").is_file() && out.join("map.md").is_file());
}
