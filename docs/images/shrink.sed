# Shrinks an SVG of `rollwalk plot --animate` by a fifth: one decimal, lines as paths, one width of spokes.
s/\.spoke\{/.spoke{stroke-width:2;/
/^<(line|ellipse|circle|path)/{
s/([0-9]\.[0-9])[0-9]+/\1/g
s/(class="spoke") stroke-width="[^"]*"/\1/
s/<line (.*)x1="([^"]*)" x2="([^"]*)" y1="([^"]*)" y2="([^"]*)"/<path \1d="M\2 \4L\3 \5"/
}
