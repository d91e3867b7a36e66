//! Which files of the data folder a test needs, and which of them are absent.

use std::path::Path;

/// The files of the data folder, a line each.
const SOURCES: &str = include_str!("../../sources.json");

/// What of the data folder is absent, in words; `None` if the test can run. `wanted` is a file, a folder, or a pattern with one
/// `*`. A folder or a pattern needs all files that `sources.json` lists for it, except those that only experiments read.
pub fn absent(folder: &Path, wanted: &str) -> Result<Option<String>, String> {
    let listed: Vec<&str> = listed(SOURCES).filter(|file| is_meant(wanted, file)).collect();
    if listed.is_empty() {
        if wanted.contains('*') {
            return Err(format!("tests/real_data/sources.json lists no file for the pattern {wanted}"));
        }
        return Ok((!folder.join(wanted).exists()).then(|| wanted.to_owned()));
    }
    let missing: Vec<&&str> = listed.iter().filter(|file| !folder.join(file).exists()).collect();
    Ok(match missing.first() {
        None => None,
        Some(_) if missing.len() == listed.len() => Some(wanted.to_owned()),
        Some(first) => Some(format!("{} of {} files of {wanted}, first {first}", missing.len(), listed.len())),
    })
}

/// Paths of the files that tests read.
fn listed(sources: &str) -> impl Iterator<Item = &str> {
    let lines = sources.lines().filter(|line| !line.contains("\"needed_by\""));
    lines.filter_map(|line| line.split_once("{\"path\": \"")?.1.split('"').next())
}

fn is_meant(wanted: &str, file: &str) -> bool {
    match wanted.split_once('*') {
        Some((start, end)) => file.strip_prefix(start).is_some_and(|rest| rest.ends_with(end)),
        None => file == wanted || file.strip_prefix(wanted).is_some_and(|rest| rest.starts_with('/')),
    }
}

#[cfg(test)]
mod tests {
    use super::{SOURCES, absent, listed};
    use std::fs;
    use std::path::PathBuf;

    /// An empty folder of this name below the temporary folder.
    fn empty(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("replica_presence_{}_{name}", std::process::id()));
        fs::create_dir_all(&folder).expect("makes");
        folder
    }

    /// Regression: a folder without one of its files made its tests fail where data is optional.
    #[test]
    fn incomplete_folder_is_absent_for_the_tests_that_read_what_it_lacks() {
        let folder = empty("incomplete");
        fs::create_dir(folder.join("kitti00")).expect("makes");
        for name in ["000094.bin", "000095.bin"] {
            fs::write(folder.join("kitti00").join(name), "").expect("writes");
        }
        let absent = |wanted: &str| absent(&folder, wanted).expect("is valid");
        assert_eq!(absent("kitti00/000094.bin"), None);
        assert_eq!(absent("kitti00/*.bin"), None);
        let words = "2 of 4 files of kitti00, first kitti00/calib_Tr_velo_to_cam0.txt";
        assert_eq!(absent("kitti00"), Some(words.to_owned()));
        assert_eq!(absent("kitti_raw_0048/*.pcd"), Some("kitti_raw_0048/*.pcd".to_owned()));
        fs::remove_dir_all(folder).expect("removes");
    }

    #[test]
    fn folder_without_a_list_of_files_needs_to_exist() {
        let folder = empty("unlisted");
        assert_eq!(absent(&folder, "another/folder"), Ok(Some("another/folder".to_owned())));
        fs::create_dir_all(folder.join("another/folder")).expect("makes");
        assert_eq!(absent(&folder, "another/folder"), Ok(None));
        assert!(absent(&folder, "another/*.bin").is_err());
        fs::remove_dir_all(folder).expect("removes");
    }

    /// `listed` reads lines instead of JSON.
    #[test]
    fn every_file_of_the_list_stands_in_a_line_of_its_own() {
        let n_paths = SOURCES.matches("\"path\":").count() - SOURCES.matches("\"needed_by\":").count();
        assert_eq!(listed(SOURCES).count(), n_paths);
        assert!(n_paths > 500, "{n_paths}");
    }
}
