//! World frame of the clouds of a run, and its accuracy.

use delivery::{Deviations, GEOREFERENCE, GeoreferenceFile};
use files::regular_file;
use std::fmt::Write;
use std::path::Path;

/// Georeference of the run in this folder. `None` without `georeference.json`, or if its version differs.
pub fn load(run: &Path) -> Option<GeoreferenceFile> {
    let text = regular_file::read_to_string(run.join(GEOREFERENCE)).ok()?;
    serde_json::from_str(&text).ok()
}

/// Lines for the operator.
pub fn lines(georeference: &GeoreferenceFile) -> String {
    let GeoreferenceFile { frame, standard_deviations, fixes, closed_loops, .. } = georeference;
    let mut lines = format!(
        "frame: {frame}\n  {} fixes used, {} rejected; {} loop closures used, {} rejected\n",
        fixes.used, fixes.refused, closed_loops.used, closed_loops.refused
    );
    if let Some(Deviations { position_m, height_m, heading_deg }) = standard_deviations {
        // Writing to a string cannot fail.
        let _ = writeln!(
            lines,
            "  largest (median) standard deviation of a submap: position {:.2} ({:.2}) m, height {:.2} ({:.2}) m, heading {:.2} \
             ({:.2}) degrees",
            position_m.largest,
            position_m.median,
            height_m.largest,
            height_m.median,
            heading_deg.largest,
            heading_deg.median
        );
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_and_standard_deviations_of_a_run_are_shown() {
        let folder = tempfile::tempdir().expect("a folder");
        assert_eq!(load(folder.path()), None);
        let text = r#"{
            "version": 1, "frame": "local east-north-up around 48.8 2.3 100, m", "trajectory_frame": "the same",
            "standard_deviations": {
                "position_m": {"median": 11.0, "largest": 28.25}, "height_m": {"median": 1.0, "largest": 3.0},
                "heading_deg": {"median": 40.0, "largest": 41.8}
            },
            "closed_loops": {"used": 2, "refused": 1}, "fixes": {"used": 12, "refused": 3}, "uprights": 4
        }"#;
        std::fs::write(folder.path().join("georeference.json"), text).expect("writes");
        let shown = lines(&load(folder.path()).expect("is there"));
        for words in [
            "frame: local east-north-up around 48.8 2.3 100, m",
            "12 fixes used, 3 rejected; 2 loop closures used, 1 rejected",
            "position 28.25 (11.00) m, height 3.00 (1.00) m, heading 41.80 (40.00) degrees",
        ] {
            assert!(shown.contains(words), "{words:?} is not in\n{shown}");
        }
    }
}
