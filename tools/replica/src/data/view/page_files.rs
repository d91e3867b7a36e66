//! The page: its source is in `tools/viewer/src`; `tools/viewer/dist` has the scripts and packages built by `npm run build`.

use file_server::{Content, Site};
use std::borrow::Cow;

/// Files by name.
const FILES: [(&str, &[u8]); 6] = [
    ("index.html", include_bytes!("../../../../viewer/src/index.html")),
    ("style.css", include_bytes!("../../../../viewer/src/style.css")),
    ("viewer.js", include_bytes!("../../../../viewer/dist/viewer.js")),
    ("worker.js", include_bytes!("../../../../viewer/dist/worker.js")),
    ("laz-perf.wasm", include_bytes!("../../../../viewer/dist/laz-perf.wasm")),
    ("licenses.txt", include_bytes!("../../../../viewer/dist/licenses.txt")),
];

/// Adds the files of the page.
pub fn add(site: &mut Site) {
    for (name, bytes) in FILES {
        site.add(name, Content::Bytes(Cow::Borrowed(bytes)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn page_names_no_other_host() {
        let (_, html) = FILES[0];
        let html = std::str::from_utf8(html).expect("text");
        assert!(html.contains("Content-Security-Policy") && html.contains("default-src 'self'"), "{html}");
        assert!(!html.contains("http://") && !html.contains("https://"), "{html}");
    }
}
