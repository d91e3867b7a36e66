//! The last lines of a stage's log, for the report of its fault.

use files::regular_file;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Lines that a report shows.
const MAX_LINES: usize = 20;
/// Bytes at the end of the log that are read.
const MAX_BYTES: u64 = 16 << 10;

/// The last lines from byte `start` on, without stack frames; then `error`, unless it is in the log.
pub fn read(log: &Path, start: u64, error: Option<&str>) -> Vec<String> {
    let mut text = Vec::new();
    // A log that cannot be read has no lines.
    if let Ok(mut file) = regular_file::open(log) {
        let length = file.metadata().map_or(0, |metadata| metadata.len());
        let _ = file.seek(SeekFrom::Start(start.max(length.saturating_sub(MAX_BYTES))));
        let _ = file.read_to_end(&mut text);
    }
    let text = String::from_utf8_lossy(&text).into_owned();
    // A backtrace would displace the lines that explain the error; it remains in the log.
    let lines: Vec<&str> = text.lines().filter(|line| !is_stack_frame(line)).collect();
    let last = &lines[lines.len().saturating_sub(MAX_LINES)..];
    let unlogged = error.filter(|error| !text.contains(*error));
    last.iter().copied().chain(unlogged).map(str::to_owned).collect()
}

/// `   7: some::function`, `             at src/file.rs:3:5`, or the head of such lines.
fn is_stack_frame(line: &str) -> bool {
    let text = line.trim_start();
    let is_indented = text.len() < line.len();
    let is_numbered = text.split_once(": ").is_some_and(|(number, _)| number.parse::<u32>().is_ok());
    text == "stack backtrace:" || (is_indented && (is_numbered || text.starts_with("at ")))
}

#[cfg(test)]
mod tests {
    use super::{MAX_LINES, is_stack_frame, read};
    use std::fmt::Write as _;

    #[test]
    fn stack_frames_are_distinguished_from_messages() {
        for frame in ["   7: core::ops::function", "             at /rustc/library/core.rs:1:2", "stack backtrace:"] {
            assert!(is_stack_frame(frame), "{frame}");
        }
        for message in ["memory allocation of 9 bytes failed", "7: not indented", "at the end", "  at", ""] {
            assert!(!is_stack_frame(message), "{message}");
        }
    }

    #[test]
    fn last_twenty_lines_of_the_process_are_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let log = folder.path().join("relay.log");
        let earlier = "a line of an earlier process\n";
        let mut text = earlier.to_owned();
        for line in 0..30 {
            writeln!(text, "line {line}").expect("a string takes everything");
        }
        std::fs::write(&log, &text).expect("written");
        let lines = read(&log, earlier.len() as u64, Some("the disk is full"));
        assert_eq!(lines.len(), MAX_LINES + 1);
        assert_eq!((lines[0].as_str(), lines[MAX_LINES].as_str()), ("line 10", "the disk is full"));
        assert_eq!(read(&log, text.len() as u64 - 8, Some("line 29")), ["line 29"], "the log has the error");
    }
}
