//! Markdown as plain text: wrapped to a width, tables in columns, headings underlined.
//!
//! It knows what the guide uses: headings, paragraphs, lists of one level, tables, fenced code, bold, links and code in
//! a line. Code keeps its backquotes, as compilers print it; a link to the web shows its address.

/// The text wrapped to a width in columns, which counts as at least 40. Code and words that are wider stick out.
pub fn plain(markdown: &str, width: usize) -> String {
    let width = width.max(40);
    let lines: Vec<&str> = markdown.lines().collect();
    let mut out = String::new();
    let mut at = 0;
    while at < lines.len() {
        let line = lines[at].trim_end();
        at += 1;
        if line.is_empty() {
            if !out.is_empty() && !out.ends_with("\n\n") {
                out.push('\n');
            }
        } else if line.starts_with("```") {
            while at < lines.len() && !lines[at].starts_with("```") {
                out.push_str(format!("    {}", lines[at]).trim_end());
                out.push('\n');
                at += 1;
            }
            at += 1;
        } else if line.starts_with('#') {
            heading(line, &mut out);
        } else if line.starts_with('|') {
            let first = at - 1;
            while at < lines.len() && lines[at].starts_with('|') {
                at += 1;
            }
            table(&lines[first..at], width, &mut out);
        } else {
            let (mark, rest) = bullet(line);
            let mut words = rest.to_string();
            while at < lines.len() && continues(lines[at]) {
                words.push(' ');
                words.push_str(lines[at].trim());
                at += 1;
            }
            let hang = " ".repeat(mark.chars().count());
            for (number, piece) in wrapped(&inline(&words), width - hang.len()).iter().enumerate() {
                out.push_str(if number == 0 { mark } else { &hang });
                out.push_str(piece);
                out.push('\n');
            }
        }
    }
    out.truncate(out.trim_end().len());
    out.push('\n');
    out
}

/// Whether a line goes on with the paragraph or item before it.
fn continues(line: &str) -> bool {
    let is_block = line.starts_with(['#', '|']) || line.starts_with("```");
    !line.trim().is_empty() && !is_block && bullet(line).0.is_empty()
}

/// The mark of a list item with its space, and what follows; no mark for other lines.
fn bullet(line: &str) -> (&str, &str) {
    let digits = line.bytes().take_while(u8::is_ascii_digit).count();
    let mark = match digits {
        0 if line.starts_with("* ") || line.starts_with("- ") => 2,
        1.. if line[digits..].starts_with(". ") => digits + 2,
        _ => 0,
    };
    line.split_at(mark)
}

fn heading(line: &str, out: &mut String) {
    let level = line.bytes().take_while(|byte| *byte == b'#').count();
    let text = inline(line[level..].trim());
    let under = match level {
        1 => "=",
        2 => "-",
        _ => "",
    };
    out.push_str(&text);
    out.push('\n');
    if !under.is_empty() {
        out.push_str(&under.repeat(text.chars().count()));
        out.push('\n');
    }
}

/// A line of Markdown without its marks: bold and links are plain, code stays as it is.
fn inline(text: &str) -> String {
    let mut out = String::new();
    for (number, piece) in text.split('`').enumerate() {
        if number > 0 {
            out.push('`');
        }
        if number % 2 == 1 {
            out.push_str(piece);
        } else {
            out.push_str(&links(&piece.replace("**", "")));
        }
    }
    out
}

/// `[words](address)` as words, with the address where it is one of the web.
fn links(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, words, address, after)) = next_link(rest) {
        out.push_str(before);
        out.push_str(words);
        if address.starts_with("http") {
            out.push_str(&format!(" ({address})"));
        }
        rest = after;
    }
    out.push_str(rest);
    out
}

fn next_link(text: &str) -> Option<(&str, &str, &str, &str)> {
    let middle = text.find("](")?;
    let begin = text[..middle].rfind('[')?;
    let end = middle + text[middle..].find(')')?;
    Some((&text[..begin], &text[begin + 1..middle], &text[middle + 2..end], &text[end + 1..]))
}

/// Lines of at most `width` columns, cut between words.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    let mut used = 0;
    for word in text.split_whitespace() {
        let length = word.chars().count();
        if used > 0 && used + 1 + length > width {
            lines.push(String::new());
            used = 0;
        }
        if let Some(line) = lines.last_mut() {
            if used > 0 {
                line.push(' ');
                used += 1;
            }
            line.push_str(word);
            used += length;
        }
    }
    lines
}

/// Columns between two cells.
const GAP: usize = 2;
/// A column is not made narrower than this to fit a table into the width, nor than its longest word.
const NARROWEST: usize = 8;

fn table(lines: &[&str], width: usize, out: &mut String) {
    let rows: Vec<Vec<String>> = lines.iter().map(|line| cells(line)).filter(|row| !is_rule(row)).collect();
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let (mut widths, mut least) = (vec![1; columns], vec![NARROWEST; columns]);
    for row in &rows {
        for (column, cell) in row.iter().enumerate() {
            let longest = cell.split_whitespace().map(|word| word.chars().count()).max().unwrap_or(0);
            widths[column] = widths[column].max(cell.chars().count());
            least[column] = least[column].max(longest);
        }
    }
    // The widest column that can gives way until all fit.
    while widths.iter().sum::<usize>() + GAP * columns.saturating_sub(1) > width {
        let can_give = (0..columns).filter(|&column| widths[column] > least[column]);
        let Some(widest) = can_give.max_by_key(|&column| widths[column]) else { break };
        widths[widest] -= 1;
    }
    for (number, row) in rows.iter().enumerate() {
        let pieces: Vec<Vec<String>> = row.iter().zip(&widths).map(|(cell, width)| wrapped(cell, *width)).collect();
        for line in 0..pieces.iter().map(Vec::len).max().unwrap_or(0) {
            let mut text = String::new();
            for (piece, width) in pieces.iter().zip(&widths) {
                let part = piece.get(line).map_or("", String::as_str);
                text.push_str(part);
                text.push_str(&" ".repeat((width + GAP).saturating_sub(part.chars().count())));
            }
            out.push_str(text.trim_end());
            out.push('\n');
        }
        if number == 0 {
            out.push_str(&"-".repeat(widths.iter().sum::<usize>() + GAP * columns.saturating_sub(1)));
            out.push('\n');
        }
    }
}

/// The cells of a row; `\|` is a bar inside a cell.
fn cells(line: &str) -> Vec<String> {
    let line = line.trim().trim_start_matches('|').replace("\\|", "\u{1}");
    let line = line.strip_suffix('|').unwrap_or(&line);
    line.split('|').map(|cell| inline(cell.trim()).replace('\u{1}', "|")).collect()
}

/// Whether a row only separates the head of a table from its body.
fn is_rule(row: &[String]) -> bool {
    row.iter().all(|cell| cell.len() >= 3 && cell.bytes().all(|byte| matches!(byte, b'-' | b':')))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paragraphs_and_items_are_wrapped_and_marks_are_gone() {
        let text = "# A title\n\nSome **bold** words with `co**de`, a [link](other.md)\nand [a page](https://example.org/a).\n\n\
                    * first item that is long enough to be wrapped here\n  goes on\n* second\n10. tenth\n";
        let expected = "\
A title
=======

Some bold words with `co**de`, a link
and a page (https://example.org/a).

* first item that is long enough to be
  wrapped here goes on
* second
10. tenth
";
        assert_eq!(plain(text, 40), expected);
    }

    #[test]
    fn code_is_kept_and_indented() {
        assert_eq!(plain("```sh\npatina fit   SCENE\n\n# a note\n```\nafter\n", 80), {
            "    patina fit   SCENE\n\n    # a note\nafter\n"
        });
        assert_eq!(plain("```text\nnever closed", 80), "    never closed\n");
    }

    #[test]
    fn tables_stand_in_columns_and_give_way() {
        let text = "| a | what it is |\n|---|:--|\n| `x \\| y` | one |\n| second | two words |\n";
        let wide = "a        what it is\n-------------------\n`x | y`  one\nsecond   two words\n";
        assert_eq!(plain(text, 80), wide);
        let long = format!("| key | meaning |\n|---|---|\n| k | {} |\n", "word ".repeat(30));
        let narrow = plain(&long, 50);
        assert!(narrow.lines().all(|line| line.chars().count() <= 50), "{narrow}");
        assert_eq!(narrow.matches("word").count(), 30);
        assert!(narrow.lines().skip(3).all(|line| line.starts_with("     ")), "{narrow}");
    }

    #[test]
    fn the_guide_loses_no_word_and_fits_a_terminal() {
        for topic in crate::guide::Topic::ALL {
            let shown = plain(topic.text(), 100);
            assert!(!shown.contains("**"), "{topic:?}");
            for line in shown.lines().filter(|line| !line.starts_with("    ")) {
                assert!(line.chars().count() <= 100, "{topic:?}: {line}");
            }
            let letters = |text: &str| text.chars().filter(|c| c.is_alphabetic()).count();
            // Names of the languages of code blocks and addresses of links inside the repository are left out.
            assert!(letters(&shown) as f64 > 0.95 * letters(topic.text()) as f64, "{topic:?}");
        }
    }

    #[test]
    fn odd_markdown_does_not_panic() {
        for text in
            ["", "|", "||", "| |\n|-|", "#", "`", "[a](", "](b)", "1.", "12345678901234567890. x", "* ", "é\u{301}|"]
        {
            assert!(plain(text, 0).ends_with('\n'), "{text}");
        }
    }
}
