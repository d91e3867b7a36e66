//! The served contents.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Contents by name, such as `index.html` or `images/1.jpg`.
#[derive(Default)]
pub struct Site(BTreeMap<String, Content>);

/// The content of a name.
pub enum Content {
    /// Bytes in memory.
    Bytes(Cow<'static, [u8]>),
    /// A file, read again for each request.
    File(PathBuf),
    /// Bytes that are computed on request. `None`: not found.
    OnRequest(Box<dyn Fn() -> Option<Vec<u8>> + Send + Sync>),
}

/// Error of a site that could not be written as a folder.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot write", path.display())]
pub struct SiteError {
    path: PathBuf,
    source: io::Error,
}

impl Site {
    /// Adds a content. Names have letters, digits and `._-/` only, so that they are the same in a URL and in a folder.
    ///
    /// # Panics
    /// If the name has other characters, or an empty part or `..`.
    pub fn add(&mut self, name: &str, content: Content) {
        let is_plain = |part: &str| {
            let mut bytes = part.bytes();
            !["", ".", ".."].contains(&part) && bytes.all(|b| b.is_ascii_alphanumeric() || b"._-".contains(&b))
        };
        assert!(name.split('/').all(is_plain), "{name:?} is not a plain name");
        self.0.insert(name.to_owned(), content);
    }

    /// The content of a name; the empty name stands for `index.html`.
    pub(crate) fn find(&self, name: &str) -> Option<(&str, &Content)> {
        let name = if name.is_empty() { "index.html" } else { name };
        self.0.get_key_value(name).map(|(name, content)| (name.as_str(), content))
    }

    /// Writes all contents as files below an existing folder, for any server with byte ranges. `progress` receives each
    /// name. Contents that cannot be computed are left out.
    pub fn write(&self, folder: &Path, mut progress: impl FnMut(&str)) -> Result<(), SiteError> {
        for (name, content) in &self.0 {
            let path = folder.join(name);
            write_content(content, &path).map_err(|source| SiteError { path, source })?;
            progress(name);
        }
        Ok(())
    }

    /// All names, sorted.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }
}

fn write_content(content: &Content, path: &Path) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    match content {
        Content::Bytes(bytes) => fs::write(path, bytes),
        Content::File(file) => fs::copy(file, path).map(drop),
        Content::OnRequest(make) => make().map_or(Ok(()), |bytes| fs::write(path, bytes)),
    }
}

/// A content that is opened for sending.
pub(crate) enum Opened<'a> {
    Bytes(Cow<'a, [u8]>),
    File(File, u64),
}

impl Content {
    /// Opens the content. `None` if it does not exist or no longer exists.
    pub(crate) fn open(&self) -> Option<Opened<'_>> {
        match self {
            Self::Bytes(bytes) => Some(Opened::Bytes(Cow::Borrowed(bytes))),
            Self::File(path) => {
                let file = File::open(path).ok()?;
                let n_bytes = file.metadata().ok()?.len();
                Some(Opened::File(file, n_bytes))
            }
            Self::OnRequest(make) => Some(Opened::Bytes(Cow::Owned(make()?))),
        }
    }
}

impl Opened<'_> {
    pub(crate) fn n_bytes(&self) -> u64 {
        match self {
            Self::Bytes(bytes) => bytes.len() as u64,
            Self::File(_, n_bytes) => *n_bytes,
        }
    }

    /// The bytes `begin..end`, which lie inside the content.
    pub(crate) fn reader(&mut self, begin: u64, end: u64) -> io::Result<Box<dyn Read + '_>> {
        match self {
            Self::Bytes(bytes) => Ok(Box::new(&bytes[begin as usize..end as usize])),
            Self::File(file, _) => {
                file.seek(SeekFrom::Start(begin))?;
                Ok(Box::new(file.take(end - begin)))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn site_is_written_as_a_folder() {
        let folder = tempfile::tempdir().expect("a folder");
        let cloud = folder.path().join("source");
        fs::write(&cloud, b"points").expect("writes");
        let mut site = Site::default();
        site.add("index.html", Content::Bytes(Cow::Borrowed(b"page")));
        site.add("cloud.laz", Content::File(cloud));
        site.add("images/0.jpg", Content::OnRequest(Box::new(|| Some(b"image".to_vec()))));
        site.add("images/1.jpg", Content::OnRequest(Box::new(|| None)));
        let out = folder.path().join("out");
        let mut names = Vec::new();
        site.write(&out, |name| names.push(name.to_owned())).expect("writes");
        assert_eq!(names, ["cloud.laz", "images/0.jpg", "images/1.jpg", "index.html"]);
        let read = |name: &str| fs::read(out.join(name)).ok();
        assert_eq!(read("cloud.laz").as_deref(), Some(&b"points"[..]));
        assert_eq!(read("images/0.jpg").as_deref(), Some(&b"image"[..]));
        assert_eq!(read("images/1.jpg"), None);
        assert_eq!(read("index.html").as_deref(), Some(&b"page"[..]));
    }

    #[test]
    #[should_panic(expected = "is not a plain name")]
    fn name_that_leaves_the_folder_is_refused() {
        Site::default().add("images/../../secret", Content::OnRequest(Box::new(|| None)));
    }
}
