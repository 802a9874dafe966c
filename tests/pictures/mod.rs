//! Masks as pictures of letters, small enough to be read in a diff, and their comparison with accepted ones.
//!
//! A missing picture fails; a failing one leaves what was drawn and the difference under `target/tmp/golden`.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// Pixels in a cell, and cells in a picture. Letters are about twice as tall as wide.
const CELL_PX: [u32; 2] = [4, 8];
const CELLS: [u32; 2] = [80, 40];
/// Width and height of the frames.
pub const SIZE_PX: [u32; 2] = [CELLS[0] * CELL_PX[0], CELLS[1] * CELL_PX[1]];
/// Share of the cells with something in them that may differ. Another machine's rounding changes cells whose mean lies
/// on a threshold, one or two; a plane that is off by two cells, or a texture that is mirrored, changes half of those
/// in shadow and more.
const TOLERANCE: f64 = 0.02;

/// One letter a cell: ` ` mostly background, `-` mostly turned away from the light; else by how much of the rest is
/// lit: `#` in shadow, `+` half and half, `.` lit.
fn letters(frame: &image::RgbaImage) -> Vec<String> {
    let letter = |column: u32, row: u32| {
        let pixels = (0..CELL_PX[0] * CELL_PX[1])
            .map(|i| frame.get_pixel(column * CELL_PX[0] + i % CELL_PX[0], row * CELL_PX[1] + i / CELL_PX[0]).0);
        let [lit, facing, covered] = pixels.fold([0; 3], |sum, p| [0, 1, 2].map(|i| sum[i] + u32::from(p[i])));
        let total = CELL_PX[0] * CELL_PX[1] * 255;
        match (2 * covered > total, 2 * facing > covered) {
            (false, _) => ' ',
            (true, false) => '-',
            (true, true) if 3 * lit < facing => '#',
            (true, true) if 3 * lit < 2 * facing => '+',
            (true, true) => '.',
        }
    };
    (0..CELLS[1]).map(|row| (0..CELLS[0]).map(|column| letter(column, row)).collect()).collect()
}

/// Where the accepted pictures of a folder lie.
pub fn golden_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{name}.txt"))
}

/// How many cells differ, and the letters drawn where they do.
fn compare(expected: &[String], actual: &[String]) -> (usize, String) {
    let (mut count, mut text) = (0, String::new());
    for (row, actual) in actual.iter().enumerate() {
        let expected = expected.get(row).map_or("", String::as_str);
        let padded = expected.chars().chain(std::iter::repeat('?')).take(actual.len());
        for (e, a) in padded.zip(actual.chars()) {
            count += usize::from(e != a);
            text.push(if e == a { ' ' } else { a });
        }
        text.push('\n');
    }
    (count, text)
}

/// Is the shadow in `frame` too little for its loss to be noticed?
pub fn shows_too_little_shadow(frame: &image::RgbaImage) -> bool {
    let cells = letters(frame);
    let count = |is: fn(char) -> bool| cells.iter().flat_map(|row| row.chars()).filter(|c| is(*c)).count() as f64;
    count(|c| c == '#') < 3.0 * TOLERANCE * count(|c| c != ' ')
}

/// Compares a mask of [`SIZE_PX`] with the accepted picture `name` (below tests/golden), or takes its place.
pub fn check(name: &str, frame: &image::RgbaImage) -> Result<(), String> {
    let actual = letters(frame);
    let tolerated = TOLERANCE * actual.iter().flat_map(|row| row.chars()).filter(|c| *c != ' ').count() as f64;
    let path = golden_path(name);
    let left = Path::new(env!("CARGO_TARGET_TMPDIR")).join("golden").join(name);
    let left = |ending: &str| left.with_extension(ending);
    fs::create_dir_all(left("txt").parent().expect("a folder")).expect("writable");
    let text = format!("{}\n", actual.join("\n"));
    if std::env::var_os("SHADOWFIT_ACCEPT").is_some_and(|value| value == "1") {
        frame.save(left("png")).expect("writable");
        fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        fs::write(&path, text).expect("writable");
        return Ok(());
    }
    let accept = "look at it, then accept it by running this test with SHADOWFIT_ACCEPT=1";
    let drawn = left("actual.txt");
    let Ok(expected) = fs::read_to_string(&path) else {
        fs::write(&drawn, text).expect("writable");
        return Err(format!("{} is missing; {} is what was drawn: {accept}", path.display(), drawn.display()));
    };
    let (different, difference) = compare(&expected.lines().map(str::to_owned).collect::<Vec<_>>(), &actual);
    if expected.lines().count() == actual.len() && different as f64 <= tolerated {
        return Ok(());
    }
    fs::write(&drawn, text).expect("writable");
    fs::write(left("difference.txt"), &difference).expect("writable");
    frame.save(left("actual.png")).expect("writable");
    Err(format!("{name}: {different} cells differ, see {}: {accept}\n{difference}", drawn.display()))
}
