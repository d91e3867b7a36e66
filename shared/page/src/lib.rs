//! Pages of reports as HTML: one column, light or dark by the setting of the reader's system, printable, without scripts.
//!
//! [`Page`] grows from top to bottom: sections, paragraphs, findings with a [`Level`], tables ([`Table`]), charts and pictures. The
//! reports of `replica report` and `replica inspect DRIVE` are such pages.
//!
//! Every text is escaped here, so that a name in a drive cannot become markup. Pictures are embedded ([`data_uri`]) or name files next
//! to the page.
//!
//! What it must never do: fetch anything from the network, contain a script, or depend on runs. It reads and writes no
//! file, and equal input gives equal bytes.
//!
//! Where to start reading: [`Page`] and its methods, in the order in which a page is written; `style.css` is the whole
//! design.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod base64;
mod table;

pub use table::Table;

use base64::base64;
use chart::escaped;
use std::fmt::{Display, Write};

const STYLE: &str = include_str!("style.css");

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// No action needed.
    Green,
    /// Needs a check.
    Amber,
    /// Not reliable.
    Red,
}

impl Level {
    /// Name of the level in the page and in its style sheet.
    pub fn word(self) -> &'static str {
        match self {
            Level::Green => "green",
            Level::Amber => "amber",
            Level::Red => "red",
        }
    }
}

/// A page under construction.
pub struct Page {
    html: String,
    /// Headings of the sections.
    sections: Vec<String>,
    /// Byte of the page before which the list of sections stands.
    contents_at: Option<usize>,
}

// Writing to a string cannot fail.
impl Page {
    /// A page with its heading.
    pub fn new(title: &str) -> Self {
        let title = escaped(title);
        let html = format!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{title}</title>\n<style>\n{STYLE}</style></head>\n<body>\n<h1>{title}</h1>\n"
        );
        Self { html, sections: Vec::new(), contents_at: None }
    }

    /// A list of the sections that follow, as links.
    pub fn contents(&mut self) {
        self.contents_at = Some(self.html.len());
        self.sections.clear();
    }

    /// Heading of a section.
    pub fn section(&mut self, heading: &str) {
        self.sections.push(heading.to_owned());
        let _ = writeln!(self.html, "<a id=\"{}\"></a><h2>{}</h2>", anchor(heading), escaped(heading));
    }

    /// Heading of a part of a section.
    pub fn subsection(&mut self, heading: &str) {
        let _ = writeln!(self.html, "<h3>{}</h3>", escaped(heading));
    }

    /// A paragraph.
    pub fn paragraph(&mut self, text: &str) {
        let _ = writeln!(self.html, "<p>{}</p>", escaped(text));
    }

    /// A line in small gray letters.
    pub fn remark(&mut self, text: &str) {
        let _ = writeln!(self.html, "<p class=\"remark\">{}</p>", escaped(text));
    }

    /// A list. An empty list is left out.
    pub fn list(&mut self, lines: impl IntoIterator<Item = impl AsRef<str>>) {
        let items: Vec<String> =
            lines.into_iter().map(|line| format!("<li>{}</li>\n", escaped(line.as_ref()))).collect();
        if !items.is_empty() {
            let _ = writeln!(self.html, "<ul>\n{}</ul>", items.concat());
        }
    }

    /// A box in the color of the level: a title and its lines.
    pub fn notice(&mut self, level: Level, title: &str, lines: impl IntoIterator<Item = impl AsRef<str>>) {
        let _ = writeln!(self.html, "<div class=\"notice {}\"><b>{}</b>", level.word(), escaped(title));
        self.list(lines);
        self.html.push_str("</div>\n");
    }

    /// A table.
    pub fn table(&mut self, table: &Table) {
        self.html.push_str(&table.html());
    }

    /// Names with small areas of a color, `#rrggbb`.
    pub fn legend(&mut self, entries: impl IntoIterator<Item = (String, String)>) {
        let entry = |(color, name): (String, String)| {
            let color = escaped(&color);
            let name = escaped(&name);
            format!("<span><i style=\"background:{color}\"></i>{name}</span>\n")
        };
        let entries: Vec<String> = entries.into_iter().map(entry).collect();
        let _ = writeln!(self.html, "<div class=\"legend\">\n{}</div>", entries.concat());
    }

    /// A chart or drawing (an `svg` element, which is not escaped), with a caption. Screen readers read the caption as the title of
    /// the drawing, or without caption the heading of the section.
    pub fn drawing(&mut self, svg: &str, caption: &str) {
        let title = if caption.is_empty() { self.sections.last().map_or("", String::as_str) } else { caption };
        let html = titled(svg, title);
        self.figure(&html, caption);
    }

    /// Figures side by side where there is room: drawings with their captions.
    pub fn drawings<'a>(&mut self, drawings: impl IntoIterator<Item = (&'a str, &'a str)>) {
        self.html.push_str("<div class=\"drawings\">\n");
        for (svg, caption) in drawings {
            self.drawing(svg, caption);
        }
        self.html.push_str("</div>\n");
    }

    /// A picture: a data URI or the name of a file next to the page, with a caption.
    pub fn picture(&mut self, source: &str, caption: &str) {
        let source = escaped(source);
        let alt = escaped(caption);
        self.figure(&format!("<img src=\"{source}\" alt=\"{alt}\">"), caption);
    }

    /// Pictures side by side where there is room.
    pub fn pictures(&mut self, pictures: impl IntoIterator<Item = (String, String)>) {
        self.html.push_str("<div class=\"pictures\">\n");
        for (source, caption) in pictures {
            self.picture(&source, &caption);
        }
        self.html.push_str("</div>\n");
    }

    /// An unformatted text in a box that opens on request.
    pub fn details(&mut self, title: &str, text: &str) {
        let title = escaped(title);
        let text = escaped(text);
        let _ = writeln!(self.html, "<details><summary>{title}</summary><pre>{text}</pre></details>");
    }

    /// A command to copy.
    pub fn command(&mut self, text: &str) {
        let _ = writeln!(self.html, "<pre>{}</pre>", escaped(text));
    }

    /// The text of the file.
    pub fn finish(mut self) -> String {
        if let Some(at) = self.contents_at {
            let link = |heading: &String| format!("<a href=\"#{}\">{}</a>\n", anchor(heading), escaped(heading));
            let links: Vec<String> = self.sections.iter().map(link).collect();
            self.html.insert_str(
                at,
                &format!("<nav class=\"contents\" aria-label=\"Contents\">\n{}</nav>\n", links.concat()),
            );
        }
        self.html + "</body></html>\n"
    }

    fn figure(&mut self, html: &str, caption: &str) {
        let _ = write!(self.html, "<figure>{html}");
        if !caption.is_empty() {
            let _ = write!(self.html, "<figcaption>{}</figcaption>", escaped(caption));
        }
        self.html.push_str("</figure>\n");
    }
}

/// The address of a section: its letters and digits.
fn anchor(heading: &str) -> String {
    let word = |word: &str| word.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_ascii_lowercase();
    heading.split_whitespace().map(word).collect::<Vec<_>>().join("-")
}

/// An `svg` element with the role of an image and a title.
fn titled(svg: &str, title: &str) -> String {
    let Some((head, content)) =
        svg.split_once('>').filter(|(head, _)| head.starts_with("<svg") && !head.ends_with('/'))
    else {
        return svg.to_owned();
    };
    let attributes = &head["<svg".len()..];
    format!("<svg role=\"img\"{attributes}><title>{}</title>{content}", escaped(title))
}

/// The address of a picture that is part of the page. `media_type`: such as `image/png`.
pub fn data_uri(media_type: &str, bytes: &[u8]) -> String {
    format!("data:{media_type};base64,{}", base64(bytes))
}

/// Formats 1234567 as "1 234 567".
pub fn grouped(n: impl Display) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (index, digit) in digits.char_indices() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOSTILE: &str = "<script>\"&'</script>";

    #[test]
    fn every_text_is_escaped() {
        let mut page = Page::new(HOSTILE);
        page.section(HOSTILE);
        page.subsection(HOSTILE);
        page.paragraph(HOSTILE);
        page.remark(HOSTILE);
        page.list([HOSTILE]);
        page.notice(Level::Red, HOSTILE, [HOSTILE]);
        page.legend([(HOSTILE.to_owned(), HOSTILE.to_owned())]);
        page.drawing("<svg></svg>", HOSTILE);
        page.picture(HOSTILE, HOSTILE);
        page.details(HOSTILE, HOSTILE);
        page.command(HOSTILE);
        let mut table = Table::new(&[HOSTILE], 1);
        table.row([HOSTILE]);
        page.table(&table);
        let html = page.finish();
        assert!(!html.contains("<script"), "{html}");
        // Title and heading, each text once, title of a drawing, caption and alternative text of a picture.
        assert_eq!(html.matches("&lt;script&gt;").count(), 21, "{html}");
    }

    #[test]
    fn contents_link_to_the_sections_that_follow() {
        let mut page = Page::new("a");
        page.section("Before");
        page.contents();
        page.section("Time & memory");
        page.section("Path");
        let html = page.finish();
        let links = "<a href=\"#time--memory\">Time &amp; memory</a>\n<a href=\"#path\">Path</a>\n</nav>";
        assert!(html.contains(links), "{html}");
        assert!(
            html.contains("<a id=\"time--memory\"></a><h2>") && html.contains("<a id=\"before\"></a><h2>"),
            "{html}"
        );
        assert!(html.find("Before") < html.find("<nav") && html.find("<nav") < html.find("<a id=\"path\""));
    }

    #[test]
    fn drawing_has_a_role_and_a_title() {
        let mut page = Page::new("a");
        page.section("Path");
        page.drawing("<svg width=\"1\"><path/></svg>", "The path");
        page.drawing("<svg><path/></svg>", "");
        let html = page.finish();
        assert!(html.contains("<svg role=\"img\" width=\"1\"><title>The path</title><path/></svg>"), "{html}");
        assert!(html.contains("<svg role=\"img\"><title>Path</title><path/></svg>"), "{html}");
    }

    #[test]
    fn page_loads_nothing() {
        let mut page = Page::new("a");
        page.picture(&data_uri("image/png", b"abc"), "b");
        let html = page.finish();
        assert!(html.contains("src=\"data:image/png;base64,YWJj\""), "{html}");
        assert!(!html.contains("http") && !html.contains("url("), "{html}");
    }

    #[test]
    fn number_of_seven_digits_is_grouped() {
        assert_eq!([0, 999, 1000, 1_234_567].map(grouped), ["0", "999", "1 000", "1 234 567"]);
    }
}
