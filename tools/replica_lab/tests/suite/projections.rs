//! `replica-lab evaluate projections`.

use crate::support::{replica_lab, succeeded, text};

#[test]
fn larger_range_images_have_fewer_collisions() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("projections.svg");
    let evaluate = ["evaluate", "projections", "--seeds", "9601", "--picture", text(&picture)];
    let table = succeeded(&replica_lab(&evaluate));
    let rows = table.lines().filter(|line| line.ends_with("% |"));
    let rows: Vec<Vec<f64>> = rows
        .map(|row| row.split('|').filter_map(|cell| cell.trim().strip_suffix(" %")?.parse().ok()).collect())
        .collect();
    assert_eq!(rows.len(), 4, "{table}");
    // An HDL-64E has about 2080 columns and 64 rows. Half of the columns lose half of the returns; twice the rows hardly help.
    let collisions: Vec<f64> = rows.iter().map(|row| row[0]).collect();
    assert!((40.0..55.0).contains(&collisions[0]) && (35.0..50.0).contains(&collisions[2]), "{table}");
    assert!(collisions[3] < collisions[1] && collisions[1] < 20.0, "{table}");
    for row in rows {
        let [collisions, all_points, k_0, k_1, k_3, ..] = row[..] else { panic!("{table}") };
        // The nearest point of a pixel keeps its class, the others get none.
        assert!((k_0 + collisions - 100.0).abs() < 1.0, "{table}");
        assert!(k_1 > all_points && (k_3 - k_1).abs() < 0.5, "{table}");
    }
    let svg = std::fs::read_to_string(&picture).expect("a picture");
    assert_eq!(svg.matches("<rect").count(), 1 + 4 + 24, "a background, and one bar per value of the table");
    let nothing = replica_lab(&["evaluate", "projections"]);
    assert_eq!(nothing.status.code(), Some(2), "no sweeps selected");
}
