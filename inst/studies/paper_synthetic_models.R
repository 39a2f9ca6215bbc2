list(M1 = paper_box("M1"), M2 = paper_box("M2"), M3 = paper_box("M3"))
