//! Recordings and clouds that `inspect` does not read, but `replica import` does.

use std::path::Path;

/// Extensions of recordings and clouds that become a drive.
const IMPORTED: [&str; 6] = ["las", "laz", "bag", "db3", "pcd", "bin"];

/// The command for a path that is, or only contains, such files; `None` for other paths.
pub(super) fn rule(path: &Path) -> Option<String> {
    let kind = |file: &Path| {
        let extension = file.extension()?.to_string_lossy().to_lowercase();
        IMPORTED.contains(&extension.as_str()).then_some(extension)
    };
    let found = if path.is_dir() {
        let mut files = path.read_dir().ok()?.flatten().map(|entry| entry.path()).collect::<Vec<_>>();
        files.sort();
        let has_clouds = files.iter().any(|file| file.extension().is_some_and(|extension| extension == "ply"));
        files.iter().find_map(|file| kind(file)).filter(|_| !has_clouds && !path.join("clouds").is_dir())
    } else {
        kind(path)
    }?;
    // Sweeps are imported by folder.
    let is_sweep = ["las", "laz", "pcd", "bin"].contains(&found.as_str());
    let source = if is_sweep && path.is_file() {
        path.parent().filter(|folder| !folder.as_os_str().is_empty())
    } else {
        Some(path)
    };
    let source = source.unwrap_or(Path::new("."));
    Some(format!(
        "{}: inspect reads drives, captures, PLY clouds, runs and recordings (.mcap) of runs, not *.{found}; make a drive of it and \
         inspect the drive: `replica import {} DRIVE && replica inspect DRIVE`",
        path.display(),
        files::shell::path(source)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn las_files_and_bags_get_the_command_that_makes_a_drive() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("A.LAS");
        std::fs::write(&path, "LASF").expect("writes");
        let import = format!("`replica import {} DRIVE && replica inspect DRIVE`", folder.path().display());
        for place in [path.as_path(), folder.path()] {
            let text = rule(place).expect("is known");
            assert!(text.contains("not *.las") && text.ends_with(&import), "{text}");
        }
        let bag = folder.path().join("a.bag");
        assert!(rule(&bag).expect("is known").contains(&format!("`replica import {} DRIVE", bag.display())));
        std::fs::write(folder.path().join("cloud.ply"), "ply").expect("writes");
        assert_eq!(rule(folder.path()), None);
        assert_eq!(rule(&folder.path().join("cloud.ply")), None);
    }
}
