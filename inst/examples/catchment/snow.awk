# The water that reaches the ground [mm/d] where some of it waits as snow: CemaNeige (Valery, Andreassian and Perrin
# 2014, J. Hydrol. 517, 1176-1187) in one band of elevation. A day is all snow at -1 degree and all rain at 3.
# melt [mm/(K d)]; covered: snow that leaves no ground bare [mm].
BEGIN { memory = 0.25 }  # of the snow's temperature, from one day to the next
{
  temperature = $column["temperature"]
  frozen = temperature <= -1 ? 1 : temperature >= 3 ? 0 : (3 - temperature) / 4
  pack += frozen * rain
  chill = memory * chill + (1 - memory) * temperature
  if (chill > 0) chill = 0
  thaw = chill == 0 && temperature > 0 ? {{melt}} * temperature : 0
  if (thaw > pack) thaw = pack
  thaw *= 0.1 + 0.9 * (pack < {{covered}} ? pack / {{covered}} : 1)
  pack -= thaw
  water = (1 - frozen) * rain + thaw
}
