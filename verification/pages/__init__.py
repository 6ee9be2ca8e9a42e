"""Pages of the verification's report: blocks in HTML and in Markdown, charts as SVG, pages with a list of them."""
