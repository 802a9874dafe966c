//! Textures: from votes on a fine grid to the few bytes of a distance field or a coverage.
//!
//! In: votes per cell (positive: block). Out: a coarse one-byte field whose bilinear value reaches the border where the
//! votes want it, or coverage, whose bilinear value is what is blocked. Method of fields: the signed distance to the border of what the smoothed votes block (exact transform of
//! Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled Functions", 2012), averaged per texel; then every
//! texel near the border in turn is set to the byte with the largest sum of blocked votes, the others frozen. That
//! step is exact: a cell's value is linear in the texel, so each cell has one byte at which it begins to block.
//! Coverage needs no descent: what it blocks is linear in all texels, so each is decided alone, by the sum of the votes
//! with the weights of bilinear interpolation.
//!
//! Not guaranteed: the best field (the descent ends in a local optimum).

use crate::{
    plane::{Encoding, OccluderTexture, SDF_BORDER, SDF_TEXELS},
    smoothing::{fill_unvoted, smoothed},
};

/// Passes over the texels; after the second little changes.
const PASSES: usize = 2;

/// Byte value at which a field begins to block.
const BORDER: f32 = SDF_BORDER * 255.0;

/// Votes on a grid over a rectangle.
#[derive(Clone, Copy, Debug)]
pub struct VoteGrid<'a> {
    /// `[row][column]`.
    pub votes: &'a [f32],
    /// Cells per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Votes with the signed distance, in cells, of each cell's centre to the border of what they block.
#[derive(Clone, Debug)]
pub struct VotedShape<'a> {
    grid: VoteGrid<'a>,
    smooth: Vec<f32>,
    distance: Vec<f32>,
}

impl<'a> VotedShape<'a> {
    /// `smoothing` 3 x 3 passes over the votes decide the first border.
    #[must_use]
    pub fn new(grid: VoteGrid<'a>, smoothing: usize) -> Self {
        let mut votes = grid.votes.to_vec();
        for _ in 0..smoothing {
            votes = smoothed(&votes, grid.width);
        }
        fill_unvoted(&mut votes, grid.width);
        let blocked: Vec<bool> = votes.iter().map(|vote| *vote > 0.0).collect();
        let [to_blocked, to_open] = [true, false].map(|kind| squared_distance(&blocked, grid.width, kind));
        // The border lies half a cell before the nearest cell of the other kind.
        let signed = |i: usize| if blocked[i] { to_open[i].sqrt() - 0.5 } else { 0.5 - to_blocked[i].sqrt() };
        Self { grid, distance: (0..blocked.len()).map(signed).collect(), smooth: votes }
    }

    /// A texture of `width` x `height` texels, 3 and up, over the rectangle of the votes.
    #[must_use]
    pub fn texture(&self, encoding: Encoding, size: (usize, usize)) -> OccluderTexture {
        match encoding {
            Encoding::Coverage => self.coverage(size),
            Encoding::Sdf => self.field(size),
        }
    }

    /// The coverage that gains most on the smoothed votes, which also decided a field's first border; the outermost
    /// ring is open, as of a field.
    #[must_use]
    pub fn coverage(&self, (width, height): (usize, usize)) -> OccluderTexture {
        let scale = Scale::new(&self.grid, (width, height));
        let mut sums = vec![0.0f32; width * height];
        for (row, votes) in self.smooth.chunks_exact(self.grid.width).enumerate() {
            let (y0, y1, fy) = scale.taps(scale.y, row, height);
            for (column, vote) in votes.iter().enumerate() {
                let (x0, x1, fx) = scale.taps(scale.x, column, width);
                for (y, weight) in [(y0, 1.0 - fy), (y1, fy)] {
                    sums[y * width + x0] += vote * weight * (1.0 - fx);
                    sums[y * width + x1] += vote * weight * fx;
                }
            }
        }
        // Texels between cells of a coarser grid.
        fill_unvoted(&mut sums, width);
        let texel = |(i, sum): (usize, &f32)| {
            let is_open = *sum <= 0.0 || on_ring(i % width, i / width, (width, height));
            if is_open { 0 } else { u8::MAX }
        };
        let texels = sums.iter().enumerate().map(texel).collect();
        OccluderTexture { width, height, encoding: Encoding::Coverage, texels }
    }

    /// The best field found of `width` x `height` texels, 3 and up, over the rectangle of the votes. The outermost ring
    /// lies inside it: around it, where no votes are known, it blocked too much (held-out error 0.091 against 0.071).
    #[must_use]
    pub fn field(&self, (width, height): (usize, usize)) -> OccluderTexture {
        let scale = Scale::new(&self.grid, (width, height));
        let range = SDF_TEXELS * 0.5 * (1.0 / scale.x + 1.0 / scale.y);
        let mut texels = vec![0u8; width * height];
        for y in 0..height {
            for x in 0..width {
                let value = BORDER + BORDER * self.mean_distance(&scale, x, y) / range;
                texels[y * width + x] = value.round().clamp(0.0, most(x, y, (width, height))) as u8;
            }
        }
        let mut texture = OccluderTexture { width, height, encoding: Encoding::Sdf, texels };
        for _ in 0..PASSES {
            self.improve(&mut texture, &scale);
        }
        texture
    }

    /// Mean of the distance over the middle of a texel.
    fn mean_distance(&self, scale: &Scale, x: usize, y: usize) -> f32 {
        let quarters = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)];
        let at = |(dx, dy): (f32, f32)| {
            let cell_x = (x as f32 + dx) / scale.x - 0.5;
            let cell_y = (y as f32 + dy) / scale.y - 0.5;
            bilinear((self.grid.width, self.grid.height), (cell_x, cell_y), |i| self.distance[i])
        };
        quarters.into_iter().map(at).sum::<f32>() * 0.25
    }

    /// One pass of exact coordinate ascent over the texels next to the border.
    fn improve(&self, texture: &mut OccluderTexture, scale: &Scale) {
        let (w, h) = (texture.width, texture.height);
        let mut begins = [0.0f32; 257];
        for y in 0..h {
            for x in 0..w {
                let i = y * w + x;
                if !near_border(texture, x, y) {
                    continue;
                }
                begins.fill(0.0);
                self.collect(texture, scale, (x, y), &mut begins);
                let (old, highest) = (usize::from(texture.texels[i]), most(x, y, (w, h)) as usize);
                let mut best = (f32::NEG_INFINITY, old);
                let mut blocked = 0.0;
                for (byte, votes) in begins.iter().enumerate().take(highest + 1) {
                    blocked += votes;
                    if blocked > best.0 || (blocked == best.0 && byte.abs_diff(old) < best.1.abs_diff(old)) {
                        best = (blocked, byte);
                    }
                }
                texture.texels[i] = best.1 as u8;
            }
        }
    }

    /// Adds each cell's votes at the byte of texel `(x, y)` from which on the cell blocks.
    fn collect(&self, texture: &OccluderTexture, scale: &Scale, (x, y): (usize, usize), begins: &mut [f32; 257]) {
        let (w, h) = (texture.width, texture.height);
        let texel = |x: usize, y: usize| f32::from(texture.texels[y * w + x]);
        let own = texel(x, y);
        for cell_y in scale.cells_y(y, self.grid.height) {
            let (y0, y1, fy) = scale.taps(scale.y, cell_y, h);
            let weight_y = if y0 == y { 1.0 - fy } else { 0.0 } + if y1 == y { fy } else { 0.0 };
            for cell_x in scale.cells_x(x, self.grid.width) {
                let vote = self.grid.votes[cell_y * self.grid.width + cell_x];
                let (x0, x1, fx) = scale.taps(scale.x, cell_x, w);
                let weight = weight_y * (if x0 == x { 1.0 - fx } else { 0.0 } + if x1 == x { fx } else { 0.0 });
                if vote == 0.0 || weight <= 0.0 {
                    continue;
                }
                let row = |y: usize| texel(x0, y) + fx * (texel(x1, y) - texel(x0, y));
                let value = row(y0) + fy * (row(y1) - row(y0));
                let begin = own + (BORDER - value) / weight;
                begins[begin.ceil().clamp(0.0, 256.0) as usize] += vote;
            }
        }
    }
}

/// Votes of the cells that a texture blocks, each by the share of it that is blocked.
#[must_use]
pub fn blocked_votes(grid: &VoteGrid, texture: &OccluderTexture) -> f64 {
    let scale = Scale::new(grid, (texture.width, texture.height));
    let texel = |x: usize, y: usize| f32::from(texture.texels[y * texture.width + x]);
    let mut sum = 0.0;
    for cell_y in 0..grid.height {
        let (y0, y1, fy) = scale.taps(scale.y, cell_y, texture.height);
        for cell_x in 0..grid.width {
            let vote = grid.votes[cell_y * grid.width + cell_x];
            if vote != 0.0 {
                let (x0, x1, fx) = scale.taps(scale.x, cell_x, texture.width);
                let row = |y: usize| texel(x0, y) + fx * (texel(x1, y) - texel(x0, y));
                let value = row(y0) + fy * (row(y1) - row(y0));
                let blocked = match texture.encoding {
                    Encoding::Coverage => f64::from(value) / 255.0,
                    Encoding::Sdf => f64::from(u8::from(value >= BORDER)),
                };
                sum += blocked * f64::from(vote);
            }
        }
    }
    sum
}

/// Texels per cell along both axes.
struct Scale {
    x: f32,
    y: f32,
}

impl Scale {
    fn new(grid: &VoteGrid, (width, height): (usize, usize)) -> Self {
        Self { x: width as f32 / grid.width as f32, y: height as f32 / grid.height as f32 }
    }

    /// The two texels between whose centres a cell's centre lies, and how far it is on the way.
    fn taps(&self, scale: f32, cell: usize, texels: usize) -> (usize, usize, f32) {
        let at = ((cell as f32 + 0.5) * scale - 0.5).clamp(0.0, (texels - 1) as f32);
        let low = (at as usize).min(texels - 2);
        (low, low + 1, at - low as f32)
    }

    fn cells_x(&self, texel: usize, cells: usize) -> std::ops::Range<usize> {
        cells_around(texel, self.x, cells)
    }

    fn cells_y(&self, texel: usize, cells: usize) -> std::ops::Range<usize> {
        cells_around(texel, self.y, cells)
    }
}

/// Cells whose value depends on a texel, and perhaps one more at each end.
fn cells_around(texel: usize, scale: f32, cells: usize) -> std::ops::Range<usize> {
    let low = (texel as f32 - 0.5) / scale - 0.5;
    let high = (texel as f32 + 1.5) / scale + 0.5;
    (low.floor().max(0.0) as usize).min(cells)..(high.ceil().max(0.0) as usize).min(cells)
}

/// The largest byte that a field's texel may have: the outermost ring stays open.
fn most(x: usize, y: usize, size: (usize, usize)) -> f32 {
    if on_ring(x, y, size) { BORDER.floor() } else { 255.0 }
}

fn on_ring(x: usize, y: usize, (width, height): (usize, usize)) -> bool {
    x == 0 || y == 0 || x == width - 1 || y == height - 1
}

/// Is one of the texel's eight neighbours on the other side of the border, or is it within a texel of it?
fn near_border(texture: &OccluderTexture, x: usize, y: usize) -> bool {
    let (w, h) = (texture.width, texture.height);
    let own = texture.is_open(texture.texels[y * w + x]);
    let rows = y.saturating_sub(1)..(y + 2).min(h);
    rows.into_iter()
        .any(|y| (x.saturating_sub(1)..(x + 2).min(w)).any(|x| texture.is_open(texture.texels[y * w + x]) != own))
}

fn bilinear((width, height): (usize, usize), (x, y): (f32, f32), value: impl Fn(usize) -> f32) -> f32 {
    let (x, y) = (x.clamp(0.0, (width - 1) as f32), y.clamp(0.0, (height - 1) as f32));
    let (x0, y0) = (x as usize, y as usize);
    let (x1, y1) = ((x0 + 1).min(width - 1), (y0 + 1).min(height - 1));
    let (fx, fy) = (x - x0 as f32, y - y0 as f32);
    let row = |y: usize| value(y * width + x0) + fx * (value(y * width + x1) - value(y * width + x0));
    row(y0) + fy * (row(y1) - row(y0))
}

/// Squared distance, in cells, of each cell to the nearest one of a kind; the squared size of the grid and more where
/// there is none.
fn squared_distance(blocked: &[bool], width: usize, kind: bool) -> Vec<f32> {
    let height = blocked.len() / width;
    let far = ((width + height) * (width + height)) as f32;
    let mut grid: Vec<f32> = blocked.iter().map(|b| if *b == kind { 0.0 } else { far }).collect();
    let longest = width.max(height);
    let mut envelope = Envelope::new(longest);
    let (mut line, mut out) = (vec![0.0f32; longest], vec![0.0f32; longest]);
    for x in 0..width {
        for y in 0..height {
            line[y] = grid[y * width + x];
        }
        envelope.transform(&line[..height], &mut out);
        for y in 0..height {
            grid[y * width + x] = out[y];
        }
    }
    for row in grid.chunks_exact_mut(width) {
        line[..width].copy_from_slice(row);
        envelope.transform(&line[..width], &mut out);
        row.copy_from_slice(&out[..width]);
    }
    grid
}

/// The lower envelope of parabolas, one rooted at each sample.
struct Envelope {
    roots: Vec<usize>,
    /// Where each parabola begins to be the lowest.
    begins: Vec<f32>,
}

impl Envelope {
    fn new(samples: usize) -> Self {
        Self { roots: Vec::with_capacity(samples), begins: Vec::with_capacity(samples) }
    }

    fn transform(&mut self, f: &[f32], out: &mut [f32]) {
        self.roots.clear();
        self.begins.clear();
        for q in 0..f.len() {
            let mut begin = f32::NEG_INFINITY;
            while let (Some(&p), Some(&last)) = (self.roots.last(), self.begins.last()) {
                // Where the parabolas at p and q cross.
                begin = ((f[q] + (q * q) as f32) - (f[p] + (p * p) as f32)) / (2 * (q - p)) as f32;
                if begin > last {
                    break;
                }
                self.roots.pop();
                self.begins.pop();
                begin = f32::NEG_INFINITY;
            }
            self.roots.push(q);
            self.begins.push(begin);
        }
        let mut k = 0;
        for (q, out) in out.iter_mut().enumerate().take(f.len()) {
            while k + 1 < self.begins.len() && self.begins[k + 1] < q as f32 {
                k += 1;
            }
            let step = q as f32 - self.roots[k] as f32;
            *out = step * step + f[self.roots[k]];
        }
    }
}
